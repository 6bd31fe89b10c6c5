"""Scenes of 360_v2: cameras of COLMAP's model at the true size of smaller photos."""

import shutil

import numpy as np
import pytest
from PIL import Image

from alignerf import poses
from alignerf.readers import projects
from tests import app_cases

# images_4 of photos of 383x254 are rounded to 96x64: not a quarter on either side.
FULL, SMALL = (383, 254), (96, 64)
PARAMS = [300.0, 310.0, 191.0, 128.0]
NAMES = [f"_DSC{number:04d}" for number in range(9)]


def write_model(folder, camtoworlds, **more):
    """A COLMAP model as 360_v2 has it."""
    more = {"params": PARAMS, "size": FULL, "suffix": ".JPG"} | more
    app_cases.write_model(folder, NAMES, camtoworlds, **more)


def write_photos(folder, names, size):
    folder.mkdir()
    for number, name in enumerate(names):
        image = np.full((size[1], size[0], 3), 20 * number, np.uint8)
        Image.fromarray(image).save(folder / f"{name}.JPG")


@pytest.fixture
def scene(tmp_path, rng):
    given = app_cases.camtoworlds(rng, len(NAMES))
    write_model(tmp_path / "sparse" / "0", given)
    write_photos(tmp_path / "images", NAMES, FULL)
    write_photos(tmp_path / "images_4", NAMES, SMALL)
    return tmp_path, given


def test_poses_and_names_are_the_models(scene):
    folder, given = scene
    views, left_out = projects.read(folder)
    assert views.names == NAMES
    assert left_out == []
    assert (views.width, views.height) == FULL
    np.testing.assert_allclose(views.camtoworlds, given, atol=1e-12)


@pytest.mark.parametrize(("images", "size"), [(1, FULL), (None, FULL), (4, SMALL)])
def test_lenses_are_those_of_the_true_size(scene, images, size):
    views, _ = projects.read(scene[0], images)
    fx, fy, cx, cy = PARAMS
    wide, high = size[0] / FULL[0], size[1] / FULL[1]
    wanted = np.array([[fx * wide, 0, cx * wide], [0, fy * high, cy * high], [0, 0, 1]])
    found = np.linalg.inv(views.pixtocams)
    np.testing.assert_allclose(found, [wanted] * len(NAMES), atol=1e-9)
    assert views.photos[3].read().shape == (size[1], size[0], 3)
    # Of the photo of the name, not of another one's.
    assert abs(int(views.photos[3].read().mean()) - 60) <= 2


def test_photos_without_a_pose_are_left_out_by_name(scene, caplog):
    folder, _ = scene
    write_photos(folder / "images_8", [*NAMES, "extra"], SMALL)
    views, left_out = projects.read(folder, 8)
    assert views.names == NAMES
    assert left_out == ["extra"]
    assert "extra" in caplog.text


def test_the_scene_runs_to_its_folder(scene, tmp_path):
    out = tmp_path / "out"
    poses.main({"source": "mipnerf360", "path": str(scene[0]), "images": 4}, out)
    found = np.load(out / "cameras.npz")
    assert (int(found["width"]), int(found["height"])) == SMALL
    assert (found["split"] == "test").sum() == 2


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (
            lambda f: shutil.rmtree(f / "images_4") or (f / "images_4").mkdir(),
            "no photo",
        ),
        (lambda f: (f / "sparse/0/images.bin").write_bytes(b"x"), "sparse/0"),
        (lambda f: (f / "sparse/0").rename(f / "sparse/a"), "neither sparse/0"),
        (lambda f: (f / "images_4").rename(f / "images_5"), "no folder images_4"),
    ],
)
def test_what_is_missing_or_broken_is_named(scene, spoil, named):
    spoil(scene[0])
    with pytest.raises(ValueError, match=named) as raised:
        projects.read(scene[0], 4)
    assert "\n" not in str(raised.value)


def test_photos_of_another_shape_are_refused(scene):
    write_photos(scene[0] / "images_2", NAMES, (96, 96))
    with pytest.raises(ValueError, match=r"images_2.*96x96.*another shape"):
        projects.read(scene[0], 2)


def test_a_wild_lens_is_named(tmp_path, rng):
    model = tmp_path / "sparse" / "0"
    params = [300.0, 310.0, 191.0, 128.0, -3.0, *[0] * 7]
    poses_of = app_cases.camtoworlds(rng, 9)
    write_model(model, poses_of, model="THIN_PRISM_FISHEYE", params=params)
    write_photos(tmp_path / "images", NAMES, FULL)
    told = r"THIN_PRISM_FISHEYE \(fx 300, .* k1 -3\) folds the image: .* is wild"
    with pytest.raises(ValueError, match=told):
        projects.read(tmp_path)
