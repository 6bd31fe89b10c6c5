"""How far COLMAP is, told by its database, which it writes at the same time."""

import ast
import functools

import numpy as np
import pycolmap
import pytest

from alignerf.colmap import mapping
from alignerf.io import images, progress


@pytest.fixture
def database(tmp_path):
    """One that knows two photos; its path is no plain part of an URI."""
    folder = tmp_path / "50% of #2?"
    folder.mkdir()
    for name, image in zip("ab", np.eye(2, dtype=np.uint8) * 255, strict=True):
        images.write(folder / f"{name}.png", np.tile(image, (64, 32, 3))[..., :3])
    path = folder / "database.db"
    pycolmap.Database.open(path).close()
    pycolmap.import_images(path, folder, image_names=["a.png", "b.png"])
    return path


def test_rows_are_counted(database, monkeypatch):
    monkeypatch.chdir(database.parent)
    # Nothing in the user's folder is run.
    (database.parent / "sqlite3.py").write_text("raise SystemExit")
    assert mapping.rows(database, "images") == 2
    assert mapping.rows(database.name, "keypoints") == 0


def test_they_are_counted_while_it_is_written(database):
    with pycolmap.Database.open(database) as opened:
        opened.write_keypoints(1, np.zeros((3, 2), np.float32))
        assert mapping.rows(database, "keypoints") == 1
        opened.write_keypoints(2, np.zeros((3, 2), np.float32))
        assert mapping.rows(database, "keypoints") == 2
    with pycolmap.Database.open(database) as opened:
        assert [len(opened.read_keypoints(of)) for of in (1, 2)] == [3, 3]


def test_what_cannot_be_counted_is_not_known(database, tmp_path, monkeypatch):
    assert mapping.rows(tmp_path / "missing.db", "images") is None
    assert not (tmp_path / "missing.db").exists()
    assert mapping.rows(database, "no_such_table") is None
    (tmp_path / "no.db").write_text("no database" * 100)
    assert mapping.rows(tmp_path / "no.db", "images") is None
    monkeypatch.setattr(mapping, "COUNT_S", 1e-3)
    assert mapping.rows(database, "images") is None
    monkeypatch.setattr(mapping.sys, "executable", str(tmp_path / "python"))
    assert mapping.rows(database, "images") is None


def test_progress_keeps_the_last_number_that_it_knows(database, monkeypatch):
    told = iter([0, 1, None, 2])
    monkeypatch.setattr(mapping, "rows", lambda *_: next(told))
    seen = []

    def watched(title, total, count, *, unit):
        seen.extend([title, total, count(), count(), count()])
        return progress.heartbeat(title)

    monkeypatch.setattr(progress, "watched", watched)
    mapping.extract_from(database, database.parent, ["a", "b"], 64, None, 99, 0)
    assert seen == ["COLMAP: features", 2, 1, 1, 2]


def test_features_are_written_while_they_are_counted(database, monkeypatch):
    often = functools.partial(progress.watched, every_s=0.002)
    monkeypatch.setattr(progress, "watched", often)
    pycolmap.set_random_seed(0)
    mapping.extract(database, database.parent, ["a", "b"], 64)
    mapping.match(database, 2, seed=0)
    assert mapping.rows(database, "keypoints") == 2
    assert mapping.rows(database, "matches") == 1


@pytest.fixture
def noisy(tmp_path, rng):
    """A database of five photos of one noise; the last one shows little of it."""
    path, names = tmp_path / "database.db", list("vwxyz")
    noise = rng.integers(0, 255, (256, 320, 3), np.uint8)
    for k, name in enumerate(names):
        image = noise[:, 16 * k : 16 * k + 256].copy()
        if name == "z":
            image[:, 32:] = 128
        images.write(tmp_path / f"{name}.png", image)
    pycolmap.Database.open(path).close()
    pycolmap.import_images(path, tmp_path)
    return path, names


def matches_in(path):
    """{number of a pair: its matches} of a database."""
    with pycolmap.Database.open(path) as opened:
        numbers, found = opened.read_two_view_geometries()
    both = zip(numbers, found, strict=True)
    return {number: pair.inlier_matches.tolist() for number, pair in both}


def test_several_processes_find_the_same_matches(noisy, monkeypatch):
    path, names = noisy
    mapping.extract(path, path.parent, names, 256)
    found = []
    for cores, least in ((1, 50), (3, 1)):
        monkeypatch.setattr(mapping.machine, "cores", lambda cores=cores: cores)
        monkeypatch.setattr(mapping, "MIN_PAIRS", least)
        one = path.with_name(f"{cores}.db")
        one.write_bytes(path.read_bytes())
        mapping.match(one, 5, seed=0)
        found.append(matches_in(one))
    assert found[0] == found[1]
    assert len(found[0]) >= 6


def test_of_several_processes_the_one_that_failed_is_told(noisy, monkeypatch):
    """The one before it is ended, and says nothing."""
    path, names = noisy
    mapping.extract(path, path.parent, names, 256)
    monkeypatch.setattr(mapping.machine, "cores", lambda: 2)
    monkeypatch.setattr(mapping, "MIN_PAIRS", 1)
    waits = "sys.argv[2].endswith('0.db') and time.sleep(60)"
    monkeypatch.setattr(mapping, "MATCH", f"import sys, time; {waits}; sys.exit('no')")
    with pytest.raises(RuntimeError, match=r"has stopped: no$"):
        mapping.match(path, 5, seed=0)


def test_a_process_that_fails_says_why(noisy, monkeypatch):
    path, names = noisy
    mapping.extract(path, path.parent, names, 256)
    monkeypatch.setattr(mapping.machine, "cores", lambda: 2)
    monkeypatch.setattr(mapping, "MIN_PAIRS", 1)
    monkeypatch.setattr(mapping, "MATCH", "raise SystemExit('disk is full')")
    with pytest.raises(OSError, match="No space left"), mapping.room_for(path):
        mapping.match(path, 5, seed=0)
    assert not list(path.parent.glob("*/*.db"))


def features_of(path):
    with pycolmap.Database.open(path) as opened:
        return [len(opened.read_keypoints(k + 1)) for k in range(5)]


def test_how_long_it_takes_is_said_before_it_does(noisy, monkeypatch, caplog):
    path, names = noisy
    caplog.set_level("INFO")
    monkeypatch.setattr(mapping, "LONG_S", 0.0)
    told, alone = [], path.with_name("alone.db")
    alone.write_bytes(path.read_bytes())

    def write(some):
        told.append((some, "5 photos: about" in caplog.text))

    options = {"max_size_px": 256, "seed": 0, "most": 100_000}
    mapping.find_matches(path, path.parent, names, write=write, **options)
    assert told == [(["v", "w", "x", "y"], False), (["z"], True)]
    # What is found is the same.
    mapping.extract_from(alone, path.parent, names, 256, None, 100_000)
    mapping.match(alone, 5, seed=0)
    each = [matches_in(one) for one in (path, alone)]
    assert each[0] == each[1]
    assert sum(map(len, each[0].values())) > 100


@pytest.mark.parametrize("most", [50, 200, 100_000])
def test_only_images_with_few_features_are_doubled(noisy, most):
    path, names = noisy
    # Either way, as COLMAP finds them by itself.
    alone = [path.with_name(f"{octave}.db") for octave in (0, -1)]
    for octave, one in zip((0, -1), alone, strict=True):
        one.write_bytes(path.read_bytes())
        mapping.extract_from(one, path.parent, names, 256, None, most, octave)
    plain, doubled = map(features_of, alone)
    mapping.extract(path, path.parent, names, 256, None, most)
    enough = np.array(plain) >= most
    assert features_of(path) == np.where(enough, plain, doubled).tolist()
    assert not path.with_suffix(".plain.db").exists()


def test_no_process_holds_a_second_sqlite(root):
    """COLMAP's own and Python's would drop each other's locks: see `mapping.COUNT`."""
    for folder in ("alignerf", "flow", "tests", "workflow"):
        for path in (root / folder).rglob("*.py"):
            if "sqlite3" not in (text := path.read_text()):
                continue
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.Import):
                    assert "sqlite3" not in [alias.name for alias in node.names], path
                elif isinstance(node, ast.ImportFrom):
                    assert node.module != "sqlite3", path
