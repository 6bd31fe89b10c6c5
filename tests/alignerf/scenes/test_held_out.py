"""No photo is trained on and scored, by whatever names its file has."""

import json
import os
import shutil

import numpy as np
import pytest

from alignerf import poses
from alignerf.io import images
from alignerf.scenes import held_out, prepare

SIDE = 32


def write_photo(path, value):
    """A grey photo of this value."""
    path.parent.mkdir(exist_ok=True, parents=True)
    images.write(path, np.full((SIDE, SIDE, 3), value, np.uint8))


def copied(source, path):
    shutil.copyfile(source, path)


def frame(name, x):
    matrix = np.eye(4)
    matrix[0, 3] = x
    return {"file_path": name, "transform_matrix": matrix.tolist()}


def blender_scene(folder, test_photo, where):
    """Three views to train on and one to score, whose photo is named as asked."""
    for number in range(3):
        write_photo(folder / f"train/r_{number}.png", 50 * number)
    write_photo(folder / "test/r_9.png", 200)
    train = [frame(f"./train/r_{number}", number) for number in range(3)]
    train += [frame(test_photo, where)] if test_photo else []
    for split, frames in (("train", train), ("test", [frame("./test/r_9", 9.0)])):
        content = {"camera_angle_x": 0.7, "frames": frames}
        (folder / f"transforms_{split}.json").write_text(json.dumps(content))
    return {"source": "blender", "path": str(folder), "min_train_views": 2}


def prepare_scene(config, tmp_path):
    poses.main(config | {"triangulate": False}, tmp_path / "out")


def test_a_scene_without_any_is_taken(tmp_path):
    prepare_scene(blender_scene(tmp_path / "in", None, 0.0), tmp_path)


@pytest.mark.parametrize("name", ["./test/r_9", "test/../test/r_9.png"])
def test_a_test_photo_in_the_training_file_is_refused(tmp_path, name):
    config = blender_scene(tmp_path / "in", name, 5.0)
    with pytest.raises(ValueError, match=r"r_9\.png, which is trained on, and .*r_9"):
        prepare_scene(config, tmp_path)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("link", [os.symlink, os.link, copied])
def test_links_and_copies_of_a_view_are_refused(tmp_path, link):
    config = blender_scene(tmp_path / "in", "train/other", 9.0)
    link(tmp_path / "in/test/r_9.png", tmp_path / "in/train/other.png")
    with pytest.raises(ValueError, match=r"are one (file|photo)"):
        prepare_scene(config, tmp_path)


def test_equal_files_of_other_cameras_are_named(tmp_path, caplog):
    config = blender_scene(tmp_path / "in", "train/other", 4.0)
    shutil.copyfile(tmp_path / "in/test/r_9.png", tmp_path / "in/train/other.png")
    prepare_scene(config, tmp_path)
    assert "test/r_9.png, which is scored, are equal files" in caplog.text


def test_photos_without_a_file_and_views_without_a_split_are_passed_over(tmp_path):
    write_photo(tmp_path / "a.png", 1)
    path = tmp_path / "a.png"
    views = prepare.PosedViews(
        names=["a", "b", "c"],
        pixtocams=np.stack([np.eye(3)] * 3),
        camtoworlds=np.stack([np.eye(4)[:3]] * 3),
        width=SIDE,
        height=SIDE,
        photos=[prepare.Photo(path), prepare.Photo(0, file=path), prepare.Photo(5)],
    )
    held_out.check("HERE", views, {"a": "train", "b": "train", "c": "test"})
    held_out.check("HERE", views, {"a": "train", "c": "test"})
    with pytest.raises(ValueError, match="HERE: "):
        held_out.check("HERE", views, {"a": "train", "b": "test"})


@pytest.mark.parametrize("metres", [1e-6, 1.0, 1e6])
def test_one_camera_is_one_in_any_unit(metres):
    """So far apart as a ten-thousandth of the capture, or ten times as far."""
    poses = np.tile(np.eye(4)[:3], (4, 1, 1))
    poses[:, 0, 3] = np.array([0, 5e-5, 1e-3, 1]) * metres
    views = prepare.PosedViews(list("abcd"), np.eye(3)[None], poses, SIDE, SIDE, [])
    assert held_out.same_camera(views, "a", "b")
    assert not held_out.same_camera(views, "a", "c")
