"""Structure from motion: our conventions, the same result twice, clear failures."""

import numpy as np
import pycolmap
import pytest
from PIL import Image

from alignerf.command import images
from alignerf.scenes import cameras, colmap, distortion
from alignerf.scenes.courtyard import scene as courtyard

# Parameters of a camera of 1024x768 with noticeable, invertible distortion.
PARAMS = {
    "SIMPLE_PINHOLE": [900.0, 500.0, 390.0],
    "PINHOLE": [900.0, 880.0, 500.0, 390.0],
    "SIMPLE_RADIAL": [900.0, 500.0, 390.0, 0.05],
    "RADIAL": [900.0, 500.0, 390.0, 0.05, -0.02],
    "OPENCV": [900.0, 880.0, 500.0, 390.0, 0.05, -0.02, 1e-3, -2e-3],
}


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    """Seven neighbouring photos of the courtyard, and their true cameras."""
    folder = tmp_path_factory.mktemp("photos")
    world = courtyard.build_world(seed=0)
    pixtocams, camtoworlds = courtyard.make_cameras(
        views=60, width=240, height=180, seed=0
    )
    names = [f"view {i}" for i in range(7)]
    for name, pixtocam, pose in zip(names, pixtocams, camtoworlds, strict=False):
        at_rest = courtyard.at_rest()
        rendered = courtyard.render(world, pixtocam, pose, 240, 180, at_rest)
        images.write(folder / f"{name}.png", rendered.image)
    return folder, names, pixtocams[:7], camtoworlds[:7]


@pytest.mark.parametrize("camera_model", PARAMS)
def test_converted_cameras_see_points_where_colmap_does(camera_model):
    options = pycolmap.SyntheticDatasetOptions()
    options.camera_model_id = getattr(pycolmap.CameraModelId, camera_model)
    options.camera_params = PARAMS[camera_model]
    model = pycolmap.synthesize_dataset(options)
    names = [image.name.removesuffix(".png") for image in model.images.values()]
    found = colmap.convert(model, [*names, "another"])
    assert found.names == sorted(names)
    assert found.left_out == ["another"]
    assert len(found.points) == len(found.colours) == len(model.points3D)
    posed = {image.name: image for image in model.images.values()}
    for i, name in enumerate(found.names):
        seen = [p for p in posed[f"{name}.png"].points2D if p.has_point3D()]
        points = np.stack([model.points3D[p.point3D_id].xyz for p in seen])
        # A camera of identity intrinsics gives the normalised pinhole point.
        normalised, depth = cameras.project(points, np.eye(3), found.camtoworlds[i])
        pixels = distortion.distort_points(
            normalised, found.camtopix[i], found.distortion[i]
        )
        assert (depth > 0).all()
        np.testing.assert_allclose(pixels, [p.xy for p in seen], atol=1e-6)


def estimate(photos, tmp_path, **options):
    folder, names, *_ = photos
    tmp_path.mkdir(exist_ok=True)
    options = {"camera_model": "SIMPLE_PINHOLE", "seed": 3} | options
    return colmap.estimate_poses(folder, tmp_path, names, **options)


def test_poses_are_near_the_truth_and_the_same_twice(photos, tmp_path):
    _, names, pixtocams, camtoworlds = photos
    found = estimate(photos, tmp_path / "a")
    assert found.names == names
    assert found.models == [7]
    assert found.mean_reprojection_error_px < 1
    assert 0 < found.points_in_3_views <= 1
    similarity = cameras.align_similarity(found.camtoworlds, camtoworlds)
    aligned = cameras.apply_similarity(found.camtoworlds, *similarity)
    baseline = np.linalg.norm(camtoworlds[0, :, 3] - camtoworlds[-1, :, 3])
    assert np.abs(aligned - camtoworlds)[:, :, 3].max() < 0.1 * baseline
    focal_px = 1 / pixtocams[0, 0, 0]
    assert found.camtopix[0, 0, 0] == pytest.approx(focal_px, rel=0.1)

    again = estimate(photos, tmp_path / "b")
    np.testing.assert_array_equal(again.camtoworlds, found.camtoworlds)
    np.testing.assert_array_equal(again.camtopix, found.camtopix)


def test_a_folder_zoomed_differently_has_one_camera_a_photo(photos, tmp_path, caplog):
    """EXIF tells of two focal lengths; what they are is left to COLMAP."""
    (tmp_path / "taken").mkdir()
    for i, name in enumerate(photos[1]):
        exif = Image.Exif()
        exif.get_ifd(0x8769)[0xA405] = 26 if i % 2 else 52
        with Image.open(photos[0] / f"{name}.png") as image:
            image.save(tmp_path / "taken" / f"{name}.jpg", quality=98, exif=exif)
    options = {"max_size_px": 1600, "seed": 0, "where": "HERE"}
    views, model, focal_px = colmap.pose_folder(
        tmp_path / "taken", tmp_path, camera_model="SIMPLE_RADIAL", **options
    )
    assert focal_px is None
    assert "several focal lengths" in caplog.text
    assert len(np.unique(model.camtopix[:, 0, 0])) == len(model.names)
    assert views.load(0).shape == (180, 240, 3)
    np.testing.assert_array_equal(views.camtoworlds, model.camtoworlds)


def test_photos_that_do_not_overlap(tmp_path):
    rng = np.random.default_rng(0)
    names = ["a", "b", "c"]
    for name in names:
        noise = rng.integers(0, 256, (12, 16, 3), dtype=np.uint8)
        images.write(tmp_path / f"{name}.png", noise.repeat(8, 0).repeat(8, 1))
    with pytest.raises(ValueError, match=r"HERE: .* registered 0 of 3 images"):
        colmap.estimate_poses(tmp_path, tmp_path, names, where="HERE")


def test_too_few_photos_and_unknown_models(tmp_path):
    with pytest.raises(ValueError, match="HERE: 2 images"):
        colmap.estimate_poses(tmp_path, tmp_path, ["a", "b"], where="HERE")
    with pytest.raises(ValueError, match=r"colmap.camera_model: .*FISHEYE"):
        colmap.estimate_poses(tmp_path, tmp_path, list("abc"), camera_model="FISHEYE")
