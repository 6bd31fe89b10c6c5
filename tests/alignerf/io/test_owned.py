"""Marks: whose a folder is, and which files in it are a user's."""

import os
import shutil

import pytest

from alignerf.io import atomic, owned


def write(folder, **files):
    with atomic.replace_folder(folder) as fresh:
        for name, content in files.items():
            (fresh / name).write_text(content)


def content(folder):
    names = sorted(set(os.listdir(folder)) - {owned.MARK})
    return {name: (folder / name).read_text() for name in names}


def test_a_folder_with_files_and_no_mark_is_a_user_s(tmp_path):
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / ".DS_Store").touch()
    owned.claim(mine)
    (mine / owned.MARK).unlink()
    (mine / "deep").mkdir()
    (mine / "deep" / "photo.jpg").touch()
    says = r"mine: has files, and none is \.why-blurry"
    for function in (owned.check, owned.claim):
        with pytest.raises(ValueError, match=says):
            function(mine)
    with pytest.raises(ValueError, match=says):
        write(mine, a="ours")
    assert sorted(os.listdir(mine)) == [".DS_Store", "deep"]
    # An empty mark, as of a machine that stopped, takes none of them for ours.
    (mine / owned.MARK).touch()
    owned.claim(mine)
    assert owned.others(mine) == ["deep/photo.jpg"]
    write(mine, a="ours")
    assert sorted(owned.files_of(mine)) == ["a", "deep/photo.jpg"]


def test_what_is_replaced_and_what_stays(tmp_path):
    """Files that are no longer made go; a user's stay, below too."""
    out = tmp_path / "out"
    write(out, a="1", b="1")
    assert owned.others(out) == []
    (out / "deep").mkdir()
    (out / "deep" / "mine").write_text("mine")
    (out / "link").symlink_to(tmp_path)
    assert owned.others(out) == ["deep/mine", "link"]
    write(out, b="2", c="2")
    assert content(out / "deep") == {"mine": "mine"}
    assert (out / "link").is_symlink()
    assert sorted(os.listdir(out)) == [owned.MARK, "b", "c", "deep", "link"]
    assert (out / "b").read_text() == "2"
    assert owned.others(out) == ["deep/mine", "link"]
    # Nothing is left of the temporary folder.
    assert os.listdir(tmp_path) == ["out"]


def test_a_user_s_file_under_a_new_name_is_not_overwritten(tmp_path):
    out = tmp_path / "out"
    write(out, a="1")
    (out / "b").write_text("mine")
    with pytest.raises(ValueError, match="out/b: not of this program: move it away"):
        write(out, a="2", b="2")
    assert content(out) == {"a": "1", "b": "mine"}


@pytest.mark.parametrize("kind", ["file", "link", "lost link"])
def test_what_stands_in_the_way_of_a_folder(tmp_path, kind):
    """Nothing is written through a user's link, nor moved before that is said."""
    out, mine = tmp_path / "out", tmp_path / "mine"
    mine.mkdir()
    (mine / "b").write_text("mine")
    write(out, a="1")
    if kind == "file":
        (out / "deep").write_text("mine")
    else:
        (out / "deep").symlink_to(mine if kind == "link" else tmp_path / "gone")
    fresh = tmp_path / "fresh"
    (fresh / "deep").mkdir(parents=True)
    (fresh / "deep" / "b").write_text("2")
    with pytest.raises(ValueError, match="out/deep: not of this program"):
        atomic.move(fresh, out)
    assert (out / "a").read_text() == "1"
    assert (mine / "b").read_text() == "mine"


def test_a_folder_in_the_place_of_a_file(tmp_path):
    out = tmp_path / "out"
    write(out, a="1")
    (out / "b").mkdir()
    (out / "b" / "mine").write_text("mine")
    with pytest.raises(ValueError, match="out/b: not of this program"):
        write(out, a="2", b="2")
    assert (out / "a").read_text() == "1"


def test_a_link_in_the_place_of_our_file_is_a_user_s(tmp_path):
    out, mine = tmp_path / "out", tmp_path / "mine"
    mine.write_text("mine")
    write(out, a="1", b="1")
    (out / "a").unlink()
    (out / "a").symlink_to(mine)
    with pytest.raises(ValueError, match="out/a: not of this program"):
        write(out, a="2")
    write(out, b="2")
    assert (out / "a").is_symlink()
    assert mine.read_text() == "mine"


def test_a_copied_mark_takes_nothing(tmp_path):
    """A user has copied our folder into itself: the outermost mark counts."""
    out = tmp_path / "out"
    write(out, a="1")
    shutil.copytree(out, out / "copy")
    assert owned.others(out) == ["copy/a"]
    write(out, a="2")
    assert content(out / "copy") == {"a": "1"}


def test_what_is_half_written_is_no_user_s(tmp_path):
    """As a killed process leaves it, beside what is whole."""
    renders = tmp_path / "renders"
    write(renders / "train", a="1")
    half = renders / atomic.temporary_prefix("test")
    half.mkdir()
    (half / "b").touch()
    (renders / "train" / f"{atomic.temporary_prefix('c')}.png").touch()
    (renders / "train" / owned.FRESH).touch()
    owned.check_replaced(renders)
    assert owned.others(renders / "train") == []


def test_a_folder_without_a_mark_is_a_user_s_wherever_it_lies(tmp_path):
    owned.claim(tmp_path / "scene")
    images = tmp_path / "scene" / "images"
    images.mkdir()
    owned.check_replaced(images)
    (images / "photo.jpg").touch()
    with pytest.raises(ValueError, match=r"images/photo\.jpg: not of this program"):
        owned.check_replaced(images)
    # A file that is to come is noted first.
    owned.put(images, ["photo.jpg"])
    owned.check_replaced(images)


def test_a_merge_that_was_killed_goes_on(tmp_path, monkeypatch):
    """Then both the old files and the new are known as ours."""
    out, replace = tmp_path / "out", os.replace
    write(out, a="1", b="1")
    (out / "mine").write_text("mine")

    def stop(source, target):
        if str(target).endswith("/out/c"):
            raise KeyboardInterrupt
        replace(source, target)

    monkeypatch.setattr(os, "replace", stop)
    with pytest.raises(KeyboardInterrupt):
        write(out, b="2", c="2")
    monkeypatch.undo()
    assert owned.others(out) == ["mine"]
    write(out, b="3", c="3")
    assert content(out) == {"b": "3", "c": "3", "mine": "mine"}


def test_a_mark_lists_nothing_outside(tmp_path):
    """Whatever somebody has written into it: what is listed is removed."""
    out = tmp_path / "out"
    write(out, a="1")
    (tmp_path / "photo").write_text("mine")
    (out / "mine").write_text("mine")
    (out / owned.MARK).write_text('["a", "../photo", "/etc/hostname"]')
    write(out, b="2")
    assert (tmp_path / "photo").read_text() == "mine"
    assert content(out) == {"b": "2", "mine": "mine"}


def test_a_user_s_file_in_what_is_removed(tmp_path):
    """Each file is looked up in the mark nearest to it."""
    out = tmp_path / "renders"
    write(out / "train", a="1")
    write(out / "test", b="1")
    owned.check_replaced(out)
    owned.check_replaced(tmp_path / "there is none")
    (out / "test" / ".snakemake_timestamp").touch()
    owned.check_replaced(out)
    (out / "notes.txt").touch()
    with pytest.raises(ValueError, match=r"renders/notes\.txt: .* replaces .*/renders"):
        owned.check_replaced(out)
    (out / "notes.txt").unlink()
    (out / "test" / "a").touch()
    with pytest.raises(ValueError, match="renders/test/a: "):
        owned.check_replaced(out)


@pytest.mark.parametrize("mark", ["{", "[1]", "[[]]", "{}", "\udcff"])
def test_a_broken_mark_lists_nothing(tmp_path, mark):
    write(tmp_path / "out", a="1")
    (tmp_path / "out" / owned.MARK).write_bytes(mark.encode(errors="surrogateescape"))
    assert owned.others(tmp_path / "out") == ["a"]
    with pytest.raises(ValueError, match="out/a: not of this program"):
        owned.check_replaced(tmp_path / "out")
