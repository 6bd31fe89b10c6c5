"""Which render belongs to which photo."""

from pathlib import Path

import pytest

from alignerf.scenes.external import renders
from tests import judged_cases
from tests.judged_cases import NAMES, picture, write_png

HELD_OUT = {name: "test" if i % 8 == 0 else "train" for i, name in enumerate(NAMES)}


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """Photos {view: path}."""
    folder = judged_cases.photos(tmp_path_factory.mktemp("photos"), size=(40, 32))
    return {name: folder / f"{name}.png" for name in NAMES}


def write(folder, *names):
    for name in names:
        write_png(folder / name, picture(0, (40, 32)))


def of(found):
    return {name: one.path.name for name, one in found.renders.items()}


def test_names_are_those_of_the_photos(tmp_path, taken):
    """Other suffixes, letters and words around a name do not matter."""
    write(
        tmp_path, "v00.png", "V01.png", "render_v02.png", "v03_rgb.png", "v04.jpg.png"
    )
    found = renders.find(tmp_path, taken)
    assert of(found)["v01"] == "V01.png"
    assert sorted(found.renders) == ["v00", "v01", "v02", "v03", "v04"]
    assert {one.split for one in found.renders.values()} == {None}


def test_links_are_followed_and_end(tmp_path, taken):
    """Splits that lie elsewhere; a link inside is no second render, nor is a ring."""
    for split, names in (("train", NAMES[1:]), ("test", NAMES[:1])):
        write(tmp_path / "far" / split, *(f"{name}.png" for name in names))
    folder = tmp_path / "renders"
    folder.mkdir()
    (folder / "train").symlink_to(tmp_path / "far" / "train")
    (folder / "test").symlink_to(tmp_path / "far" / "test")
    (folder / "latest").symlink_to(folder)
    (tmp_path / "far" / "train" / "back").symlink_to(folder)
    found = renders.find(folder, taken)
    assert {n: one.split for n, one in found.renders.items()} == HELD_OUT


def test_nerfstudio(tmp_path, taken):
    """ns-render dataset; its copies of photos and coloured depths are none."""
    for split, names in (("train", NAMES[1:]), ("test", NAMES[:1])):
        for kind in ("rgb", "gt-rgb", "depth", "background", "pred_normals"):
            write(tmp_path / split / kind, *(f"{name}.png" for name in names))
    found = renders.find(tmp_path, taken)
    assert {n: one.split for n, one in found.renders.items()} == HELD_OUT
    assert all("/rgb/" in str(one.path) for one in found.renders.values())


def test_gaussian_splatting(tmp_path, taken):
    """render.py numbers each split by name; the last iteration counts."""
    for number in (7000, 30000):
        for split, count in (("train", 7), ("test", 1)):
            folder = tmp_path / split / f"ours_{number}"
            for kind in ("renders", "gt"):
                write(folder / kind, *(f"{i:05}.png" for i in range(count)))
    found = renders.find(tmp_path, taken)
    assert {n: one.split for n, one in found.renders.items()} == HELD_OUT
    assert found.renders["v00"].path.name == "00000.png"
    assert found.renders["v01"].path.name == "00000.png"
    assert all("ours_30000" in str(one.path) for one in found.renders.values())


def test_gsplat(tmp_path, taken):
    """Photo and render side by side, of held-out views, of the last step."""
    write(tmp_path / "renders", "val_step6999_0000.png", "val_step29999_0000.png")
    found = renders.find(tmp_path, taken)
    assert of(found) == {"v00": "val_step29999_0000.png"}
    assert found.renders["v00"].part == "right"
    assert found.renders["v00"].split == "test"


def test_gsplat_of_all_views(tmp_path, taken):
    """With --test-every 1 all are numbered; what was learnt from, the cameras say."""
    write(tmp_path, *(f"val_step9_{i:04}.png" for i in range(8)))
    found = renders.find(tmp_path, taken)
    assert of(found)["v05"] == "val_step9_0005.png"
    assert {n: one.split for n, one in found.renders.items()} == HELD_OUT


def test_gaussian_splatting_that_held_nothing_out(tmp_path, taken):
    folder = tmp_path / "train" / "ours_30000" / "renders"
    write(folder, *(f"{i:05}.png" for i in range(8)))
    found = renders.find(tmp_path, taken)
    assert of(found)["v00"] == "00000.png"
    assert {one.split for one in found.renders.values()} == {"train"}


def test_gsplat_of_more_views_than_there_are(tmp_path, taken):
    write(tmp_path, "val_step9_0000.png", "val_step9_0001.png")
    with pytest.raises(
        ValueError, match=r"val_step9_0001\.png: there are 1 test views"
    ):
        renders.find(tmp_path, taken)


@pytest.mark.parametrize(
    ("layout", "last"),
    [
        ("val_step9_{:04}.png", 11),
        ("train/ours_7/renders/{:05}.png", 11),
        ("train/ours_7/renders/{:05}.png", 10**30),
    ],
)
def test_as_many_as_views_but_under_another_number(tmp_path, taken, layout, last):
    files = [layout.format(number) for number in (*range(7), last)]
    write(tmp_path, *files)
    says = rf"{files[-1]}: there are 8 views by the .*, so none has the number {last}$"
    with pytest.raises(ValueError, match=says):
        renders.find(tmp_path, taken)


def test_a_render_of_gaussian_splatting_has_a_number(tmp_path, taken):
    write(tmp_path / "train" / "ours_7" / "renders", "00000.png", "²².png")
    with pytest.raises(ValueError, match=r"²²\.png: not a number"):
        renders.find(tmp_path, taken)


def test_numbers_in_the_order_of_names(tmp_path, taken):
    """As many as photos, or as there are held-out ones."""
    write(tmp_path / "all", *(f"color_{i}.png" for i in range(8, 16)))
    assert of(renders.find(tmp_path / "all", taken))["v03"] == "color_11.png"
    write(tmp_path / "few", "color_000.png")
    found = renders.find(tmp_path / "few", taken)
    assert found.renders["v00"].split == "test"


def test_the_cameras_say_what_is_held_out(tmp_path, taken):
    own = {name: "test" if name in ("v02", "v05") else "train" for name in NAMES}
    for i, shown in enumerate((2, 5)):
        write_png(tmp_path / "test" / f"{i:03}.png", picture(shown, (40, 32)))
    assert set(renders.find(tmp_path, taken, own).renders) == {"v02", "v05"}


@pytest.mark.parametrize(
    ("files", "says"),
    [
        (["a.png", "b.png"], "not called like the photos"),
        (["v00.png", "x/v00.png"], "both of view v00"),
        ([], "no renders"),
    ],
)
def test_what_cannot_be_told_is_said(tmp_path, taken, files, says):
    write(tmp_path, *files)
    with pytest.raises(ValueError, match=says):
        renders.find(tmp_path, taken)


def test_no_folder(tmp_path, taken):
    with pytest.raises(ValueError, match="no folder of renders"):
        renders.find(tmp_path / "gone", taken)


def test_a_render_of_no_photo_is_left_out(tmp_path, taken, caplog):
    write(tmp_path, "v00.png", "sky.png")
    assert list(renders.find(tmp_path, taken).renders) == ["v00"]
    assert "sky.png" in caplog.text


def test_of_folders_of_steps_the_last_counts(tmp_path, taken):
    """Those of cameras are no steps, though their files may be called alike."""
    for step in (5000, 30000):
        write(tmp_path / f"eval_{step}", *(f"{name}.png" for name in taken))
    found = renders.find(tmp_path, taken)
    assert len(found.renders) == len(taken)
    assert {one.path.parent.name for one in found.renders.values()} == {"eval_30000"}
    few = [Path(f"cam{i}/v00.png") for i in range(2)]
    assert renders.of_last(few, {}) == few


@pytest.mark.parametrize("place", ["out.mp4", "."])
def test_a_film_is_told_how_to_become_renders(tmp_path, taken, place):
    (tmp_path / "out.mp4").write_bytes(b"")
    with pytest.raises(ValueError, match=r"out\.mp4: a video: .* ffmpeg -i"):
        renders.find(tmp_path / place, taken)


def test_a_folder_of_photos_by_its_name_is_told_from_that_of_renders(tmp_path, taken):
    write(tmp_path / "ours_7" / "gt", *(f"{i:05}.png" for i in range(8)))
    assert len(renders.find(tmp_path / "ours_7" / "gt", taken).renders) == 8
    write(tmp_path / "ours_7" / "renders", "00000.png")
    with pytest.raises(
        ValueError, match=r"photos, by its name: renders lie in .*renders"
    ):
        renders.find(tmp_path / "ours_7" / "gt", taken)
