"""Folders of apps and COLMAP: what they are taken for, and what they lack."""

import pytest
import yaml

from alignerf.cli import __main__ as start
from alignerf.cli import folders
from alignerf.experiment import check


def fill(folder, *names):
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text('{"poses": []}' * name.startswith("metadata"))
    return folder


POLYCAM = ("keyframes/images/1.jpg", "keyframes/cameras/1.json")
CORRECTED = (
    "keyframes/corrected_images/1.jpg",
    "keyframes/corrected_cameras/1.json",
)
FILES = {
    "polycam": (*POLYCAM, "thumbnail.jpg", "polycam.mp4", "mesh_info.json"),
    "scanner3d": (
        "frame_00000.json",
        "frame_00000.jpg",
        "info.json",
        "depth_00000.png",
    ),
    "record3d": ("metadata.json", "rgb/0.jpg", "depth/0.exr"),
}


@pytest.mark.parametrize(
    ("names", "source"),
    [
        *((names, source) for source, names in FILES.items()),
        (("images/1.jpg", "cameras/1.json"), "polycam"),
        (("metadata", "rgbd/0.jpg"), "record3d"),
        (("images/a.jpg", "sparse/cameras.txt", "sparse/images.txt"), "mipnerf360"),
        (
            (
                *("images/a.jpg", "images_2/a.jpg"),
                *("colmap/sparse/0/cameras.bin", "colmap/sparse/0/images.bin"),
            ),
            "mipnerf360",
        ),
        (("a.jpg", "cameras.txt", "images.txt"), "mipnerf360"),
        # nerfstudio has been here.
        ((*POLYCAM, "transforms.json"), "transforms"),
        # Others have such folders, too.
        (("a.jpg", "metadata.json"), "photos"),
        (("a.jpg", "depth/1.png"), "photos"),
        (("a.jpg", "rgb/1.jpg"), "photos"),
        (("a.jpg", "cameras/b.json"), "photos"),
    ],
)
def test_names_tell_which_app_or_model_a_folder_is_of(tmp_path, names, source):
    folder = fill(tmp_path / "scan", *names)
    scene = {"source": source, "path": str(folder)}
    assert folders.scenes_of(folder) == {"scan": scene}


def test_photos_in_rgb_are_one_scene_whatever_is_beside(tmp_path):
    names = ("rgb/rgb_0.png", "depth/depth_0.png", "semantic/1.png", "traj_w_c.txt")
    folder = fill(tmp_path / "office", *names)
    (folder / "metadata.json").write_text('{"warp": 0}')
    scene = {"source": "photos", "path": str(folder / "rgb")}
    assert folders.scenes_of(folder) == {"office": scene}


@pytest.mark.parametrize(
    ("names", "named"),
    [
        (POLYCAM[:1], r"no cameras beside images.*developer mode.*keyframes/images as"),
        (POLYCAM[1:], "no images"),
        (("keyframes/depth/1.png", "keyframes/cameras/1.json"), "no images"),
        (("frame_00000.json", "info.json"), r"no frame_\*\.jpg: export.*All Data"),
        (("frame_00000.json", "frame_1.jpg"), "no photo has a frame_"),
        (("metadata.json", "depth/0.exr"), r"no rgb/<n>\.jpg"),
        (("metadata.json", "rgb/a.txt"), r"no <n>\.jpg"),
        (("images/a.jpg", "sparse/images.txt"), r"without cameras\.txt.*images as the"),
    ],
)
def test_a_folder_that_is_nearly_one_says_what_is_missing(tmp_path, names, named):
    folder = fill(tmp_path / "scan", *names)
    with pytest.raises(ValueError, match=named) as raised:
        folders.scenes_of(folder)
    assert str(folder) in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("source", FILES)
def test_a_phones_poses_and_colmaps_are_two_scenes(here, source, capsys):
    fill(here / "scan", *FILES[source])
    start.main(["scan", "--only-config", "--name", "desk"])
    written = yaml.safe_load((here / "results/desk.yaml").read_text())
    scene = {"source": source, "path": "scan"}
    wanted = {"desk": scene, "desk_colmap": scene | {"poses": "colmap"}}
    assert written["scenes"] == wanted
    found = check.checked(written).scenes
    assert [found[name].poses for name in wanted] == ["adjusted", "colmap"]
    # Windows have the poses of the scene that they are of.
    assert found["desk_colmap_crops"].poses == "colmap"
    said = capsys.readouterr().out
    assert "For the phone's alone, delete desk_colmap under scenes in" in said
    assert "delete desk_colmap under scenes in results/desk.yaml" in said


def test_a_scene_that_was_deleted_stays_deleted(here, capsys):
    fill(here / "scan", *FILES["polycam"])
    start.main(["scan", "--only-config"])
    path = here / "results/scan.yaml"
    written = yaml.safe_load(path.read_text())
    del written["scenes"]["scan_colmap"]
    path.write_text(yaml.safe_dump(written))
    start.main(["scan", "--only-config"])
    assert list(yaml.safe_load(path.read_text())["scenes"]) == ["scan"]
    assert "scan_colmap" not in capsys.readouterr().out.rpartition("config: ")[2]


def test_optimised_poses_are_one_scene(here, capsys):
    fill(here / "scan", *POLYCAM, *CORRECTED)
    start.main(["scan", "--only-config"])
    written = yaml.safe_load((here / "results/scan.yaml").read_text())
    assert list(written["scenes"]) == ["scan"]
    assert "pixels of error" not in capsys.readouterr().out


def test_two_scenes_of_one_name_are_refused(here):
    fill(here / "all", *(f"scan/{name}" for name in POLYCAM), "scan_colmap/a.jpg")
    with pytest.raises(ValueError, match="another scene is called scan_colmap"):
        start.main(["all", "--only-config"])
