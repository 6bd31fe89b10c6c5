"""NeRF's synthetic scenes: their own split, and photos on a background."""

import json
import math
import shutil

import numpy as np
import pytest
from PIL import Image

from alignerf import poses
from alignerf.captures import base, blender
from alignerf.experiment import check
from alignerf.experiment.checks import scenes as of_scenes

SIZE, ANGLE = 40, 0.7
COLOUR, ALPHA = np.array([200, 100, 0]), np.array([0, 64, 255])


def read(folder, background):
    scene = {"source": "blender", "path": str(folder), "background": background}
    return blender.CAPTURE.read_given(of_scenes.checked(scene))


def write_photo(path):
    """Three columns of pixels: nothing, a quarter, and all of one colour."""
    path.parent.mkdir(exist_ok=True)
    image = np.zeros((SIZE, SIZE, 4), np.uint8)
    image[..., :3] = COLOUR
    image[..., 3] = np.repeat(ALPHA, [10, 10, SIZE - 20])
    Image.fromarray(image).save(path)


@pytest.fixture
def scene(tmp_path):
    for split, count in (("train", 3), ("val", 1), ("test", 2)):
        frames = []
        for number in range(count):
            write_photo(tmp_path / split / f"r_{number}.png")
            pose = np.eye(4)
            pose[0, 3] = number + 10 * (split == "test")
            name = f"./{split}/r_{number}"
            frames.append({"file_path": name, "transform_matrix": pose.tolist()})
        path = tmp_path / f"transforms_{split}.json"
        path.write_text(json.dumps({"camera_angle_x": ANGLE, "frames": frames}))
    return tmp_path


def test_views_have_the_split_of_their_file(scene, tmp_path):
    views, left_out = read(scene, "white")
    assert left_out == []
    assert views.names == [
        "train_r_0",
        "train_r_1",
        "train_r_2",
        "test_r_0",
        "test_r_1",
    ]
    np.testing.assert_array_equal(views.camtoworlds[:, 0, 3], [0, 1, 2, 10, 11])
    focal_px = 0.5 * SIZE / math.tan(0.5 * ANGLE)
    np.testing.assert_allclose(1 / views.pixtocams[:, 0, 0], focal_px)
    out = tmp_path / "out"
    config = {"source": "blender", "path": str(scene), "background": "white"}
    poses.main(config, out)
    with np.load(out / "cameras.npz") as found:
        assert found["names"].tolist() == sorted(views.names)
        assert found["split"].tolist() == ["test"] * 2 + ["train"] * 3


def test_masks_and_names_come_along(scene):
    """Masks of frames that have one; lists of nerfstudio's mean nothing here."""
    path = scene / "transforms_train.json"
    content = json.loads(path.read_text())
    mask = np.zeros((SIZE, SIZE), np.uint8)
    Image.fromarray(mask).save(scene / "train" / "mask.png")
    content["frames"][1]["mask_path"] = "train/mask.png"
    content |= {"train_filenames": ["train/r_0"], "test_filenames": ["train/r_1"]}
    path.write_text(json.dumps(content))
    views, _ = read(scene, "white")
    assert len(views.names) == 5
    shown = [views.masks[view].read().max() for view in range(5)]
    assert shown == [255, 0, 255, 255, 255]
    assert blender.prefixed("train", "0") == "train_0"
    assert blender.prefixed("train", "train_0") == "train_0"


@pytest.mark.parametrize(("background", "level"), [("white", 255), ("black", 0)])
def test_transparent_pixels_stand_on_the_background(scene, background, level):
    image = read(scene, background)[0].photos[4].read()
    share = ALPHA[:, None] / 255
    wanted = np.round(share * COLOUR + (1 - share) * level)
    np.testing.assert_array_equal(image[0, [0, 15, 39]], wanted)


def test_without_a_background_they_are_refused_by_name(scene):
    with pytest.raises(
        ValueError, match=r"r_0\.png has transparent pixels.*background"
    ):
        read(scene, None)[0].photos[0].read()


def test_splits_of_two_sizes_lie_on_one_canvas(scene):
    for path in (scene / "test").iterdir():
        Image.new("RGB", (32, 32)).save(path)
    views, _ = read(scene, "white")
    assert (views.width, views.height) == (SIZE, SIZE)
    np.testing.assert_allclose(views.pixtocams[:, 0, 0], views.pixtocams[0, 0, 0])


@pytest.mark.parametrize(
    ("scene", "key"),
    [
        ({"source": "llff", "path": "x", "background": "white"}, "background"),
        ({"source": "llff", "path": "x", "images": 2}, "images"),
        ({"source": "courtyard", "background": "white"}, "background"),
    ],
)
def test_keys_that_act_on_nothing_are_refused(scene, key):
    with pytest.raises(ValueError, match=rf"config: {key}: source"):
        of_scenes.checked(scene)


def test_frames_without_a_photo_are_named(scene):
    (scene / "train" / "r_1.png").unlink()
    views, left_out = read(scene, "white")
    assert left_out == ["r_1"]
    assert len(views.names) == 4
    path = scene / "transforms_test.json"
    path.write_text((text := path.read_text()).replace("[[1.0", "[[NaN", 1))
    assert path.read_text() != text
    with pytest.raises(ValueError, match=r"is to be scored, without pose"):
        read(scene, "white")
    path.write_text(text)
    (scene / "test" / "r_0.png").unlink()
    with pytest.raises(ValueError, match=r"no photo \./test/r_0,"):
        read(scene, "white")
    for path in ("test", "val"):
        shutil.rmtree(scene / path)
    # The training photo of that name is another one.
    with pytest.raises(ValueError, match=r"no photo \./test/r_0, \./test/r_1.*rename"):
        read(scene, "white")
    (scene / "transforms_train.json").rename(scene / "transforms.json")
    assert base.detected(scene).name == "transforms"


def test_its_files_say_what_is_held_out():
    scene = {"source": "blender", "path": ".", "test_every": 4}
    with pytest.raises(ValueError, match=r"scenes.lego.test_every: blender's files"):
        check.checked({"scenes": {"lego": scene}})
