"""A photo that was overwritten is not paired with the cameras of another one."""

import contextlib
import os
import shutil
from pathlib import Path

import pytest

from alignerf import export, poses
from alignerf.io import images, json_files
from alignerf.judged import originals
from alignerf.verdict import evidence
from tests import judged_cases as cases

CONFIG = {"source": "transforms", "path": "scan", "poses": "input"}


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("prepared")
    cases.photos(folder / "scan/images")
    cases.transforms(folder / "scan/transforms.json", lens=[0.0] * 5)
    with contextlib.chdir(folder):
        poses.main(CONFIG, "out")
    return folder


@pytest.fixture
def scene(prepared, tmp_path, monkeypatch):
    """A prepared scene in `out`, of photos in scan/images."""
    shutil.copytree(prepared, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_what_is_noted(scene):
    """Photos and cameras, by the paths that the config has."""
    photos = {f"scan/images/{name}.png" for name in cases.NAMES}
    assert originals.noted("out").keys() == photos | {"scan/transforms.json"}
    assert originals.changed("out") == []
    originals.check("out")


def test_poses_are_found_anew_from_the_folder_of_the_photos(scene):
    """Not from one with the cameras in it, which are found again."""
    told = 'make photos FOLDER=scan/images OPTIONS="--name out_colmap"'
    found = json_files.read("out/poses.json")
    assert evidence.by_colmap(found, Path("out")) == told
    shutil.copy("scan/transforms.json", "scan/images")
    assert originals.alone(originals.noted("out")) is None


def test_a_copy_of_the_same_is_no_change(scene):
    os.utime("scan/images/v03.png", (1, 1))
    shutil.copy("scan/images/v04.png", "again.png")
    os.replace("again.png", "scan/images/v04.png")
    originals.check("out")


@pytest.mark.parametrize(
    "way", ["other photo", "same size and time", "gone", "cameras"]
)
def test_a_change_is_named(scene, way):
    path = scene / "scan/images/v03.png"
    found = path.stat()
    if way == "gone":
        path.unlink()
    elif way == "cameras":
        path = scene / "scan/transforms.json"
        path.write_text(path.read_text() + " ")
    else:
        images.write(path, cases.picture(70))
        if way != "other photo":
            # Its head is longer by what is missing.
            path.write_bytes(path.read_bytes()[: found.st_size].ljust(found.st_size))
    assert originals.changed("out") == [str(path.relative_to(scene))]
    says = rf"{path.name}: changed since the cameras of out"
    with pytest.raises(ValueError, match=says):
        originals.check("out")
    words = ["--scene", "out", "--config", '{"source": "transforms", "path": "scan"}']
    with pytest.raises(ValueError, match=says):
        export.main([*words, "--out", "exported"])
    assert not (scene / "exported").exists()


@pytest.mark.parametrize("told", ["5", "[5]", '["a", 1, "b"]', "null", "[1, 2, 3]"])
def test_a_damaged_note_is_named(scene, told):
    (scene / "out/images/originals.json").write_text(f'{{"a.jpg": {told}}}')
    with pytest.raises(ValueError, match=r"originals\.json: a\.jpg is "):
        originals.check("out")


def test_a_scene_without_a_note_is_as_it_was(scene):
    """As one of an older version."""
    os.unlink("out/images/originals.json")
    os.unlink("scan/images/v03.png")
    originals.check("out")
