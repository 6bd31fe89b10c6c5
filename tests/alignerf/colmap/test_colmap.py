"""Structure from motion: our conventions, the same result twice, clear failures."""

import cv2
import numpy as np
import pycolmap
import pytest
from PIL import Image

from alignerf.colmap import ingest, mapping, structure
from alignerf.io import images
from alignerf.scenes import cameras, distortion
from tests import courtyard_photos

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
    return folder, *courtyard_photos.write(folder, 7)


@pytest.mark.parametrize("camera_model", PARAMS)
def test_converted_cameras_see_points_where_colmap_does(camera_model):
    options = pycolmap.SyntheticDatasetOptions()
    options.camera_model_id = getattr(pycolmap.CameraModelId, camera_model)
    options.camera_params = PARAMS[camera_model]
    model = pycolmap.synthesize_dataset(options)
    names = [image.name.removesuffix(".png") for image in model.images.values()]
    found = structure.convert(model, [*names, "another"])
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
    return structure.estimate_poses(folder, tmp_path, [camera_of(names)], **options)


def camera_of(names):
    return ingest.Camera(names, (240, 180), (240, 180), None)


def test_poses_are_near_the_truth_and_the_same_twice(photos, tmp_path):
    _, names, pixtocams, camtoworlds = photos
    found = estimate(photos, tmp_path / "a")
    assert found.names == names
    assert found.models == [7]
    assert found.mean_reprojection_error_px < 1
    similarity = cameras.align_similarity(found.camtoworlds, camtoworlds)
    aligned = cameras.apply_similarity(found.camtoworlds, *similarity)
    baseline = np.linalg.norm(camtoworlds[0, :, 3] - camtoworlds[-1, :, 3])
    assert np.abs(aligned - camtoworlds)[:, :, 3].max() < 0.1 * baseline
    focal_px = 1 / pixtocams[0, 0, 0]
    assert found.camtopix[0, 0, 0] == pytest.approx(focal_px, rel=0.1)

    again = estimate(photos, tmp_path / "b")
    np.testing.assert_array_equal(again.camtoworlds, found.camtoworlds)
    np.testing.assert_array_equal(again.camtopix, found.camtopix)


def pose_taken(photos, tmp_path, take):
    """pose_folder of photos saved as `take` says: i -> (image [h, w, 3], EXIF)."""
    (tmp_path / "taken").mkdir()
    for i, name in enumerate(photos[1]):
        image, orientation = take(i, images.read(photos[0] / f"{name}.png"))
        exif = Image.Exif()
        exif[0x0112] = orientation
        path = tmp_path / "taken" / f"{name}.png"
        Image.fromarray(np.ascontiguousarray(image)).save(path, exif=exif)
    options = {"max_size_px": 200, "seed": 0, "where": "HERE"}
    return structure.pose_folder(
        tmp_path / "taken", tmp_path, camera_model="SIMPLE_RADIAL", **options
    )


def test_portrait_and_landscape_of_one_sensor_are_one_camera(photos, tmp_path):
    """A phone held otherwise stores the same rows, and says so."""
    views, model, taken = pose_taken(
        photos, tmp_path, lambda i, image: (image, 6 if i < 2 else 1)
    )
    assert set(model.camera_of) == {model.camera_of[0]}
    assert [lay.turns for lay in taken.lays] == [1, 1, 0, 0, 0, 0, 0]
    assert (views.width, views.height) == (240, 180)
    assert views.photos[0].read().shape == (180, 240, 3)
    # The features were seen at 200 px, the camera is that of the photo.
    assert views.pixtocams[0][0, 2] / views.pixtocams[0][0, 0] == pytest.approx(
        -120, abs=3
    )
    kept = pycolmap.Reconstruction(tmp_path / "colmap")
    kept.update_point_3d_errors()
    assert kept.compute_mean_reprojection_error() == pytest.approx(
        model.mean_reprojection_error_px, rel=1e-3
    )
    assert {image.name for image in kept.images.values()} == {
        path.name for path in taken.paths
    }
    (camera,) = kept.cameras.values()
    assert (camera.width, camera.height) == (240, 180)
    assert model.camtopix[0][0, 0] == pytest.approx(camera.focal_length, rel=1e-6)


def test_photos_turned_by_a_program_have_a_camera_of_their_own(
    photos, tmp_path, caplog
):
    views, model, taken = pose_taken(
        photos, tmp_path, lambda i, image: (np.rot90(image, -1) if i < 3 else image, 1)
    )
    assert [lay.kind for lay in taken.lays] == ["across"] * 3 + ["sensor"] * 4
    assert len(set(model.camera_of)) == 2
    assert "2 cameras: 3 of 240x180, 4 of 240x180" in caplog.text
    # They lie as the others do again.
    first = images.read(photos[0] / f"{photos[1][0]}.png")
    np.testing.assert_array_equal(taken.load(0), first)
    np.testing.assert_array_equal(views.camtoworlds, model.camtoworlds)


def test_photos_of_another_size_and_lens_are_laid_on_one_canvas(photos, tmp_path):
    """Three photos of fewer pixels, cut to another shape."""

    def take(i, image):
        if i % 2 == 0:
            return image, 1
        small = cv2.resize(image, (180, 135), interpolation=cv2.INTER_AREA)
        return small[8:127], 1

    views, _, taken = pose_taken(photos, tmp_path, take)
    assert sorted(set(taken.sizes)) == [(180, 119), (240, 180)]
    assert (views.width, views.height) == (240, 180)
    names = photos[1]
    smaller = set(names[1::2]) & set(views.names)
    assert len(smaller) >= 2
    for name in smaller:
        i = views.names.index(name)
        image, mask = views.photos[i].read(), views.masks[i].read() == 255
        whole = images.read(photos[0] / f"{name}.png")
        # As large again, in the middle; what it does not see is free.
        assert 0.85 < mask.all(axis=-1).mean() < 0.93
        inner = mask.all(axis=-1) & np.pad(np.ones((120, 180), bool), ((30, 30),) * 2)
        difference = np.abs(image.astype(int) - whole)[inner]
        assert np.median(difference) < 12
        assert not image[~mask.all(axis=-1)].any()
    for i, name in enumerate(views.names):
        if name in names[0::2]:
            assert (views.masks[i].read() == 255).all()
    # All at one angle a pixel, each with its own axis.
    focal_px = np.linalg.inv(views.pixtocams)[:, [0, 1], [0, 1]]
    np.testing.assert_allclose(focal_px, np.median(focal_px), rtol=0.02)


def test_masks_go_the_way_of_their_photos(photos, tmp_path):
    """What a mask hides gives no feature and does not count."""
    (tmp_path / "masks").mkdir()
    mask = np.full((180, 240, 3), 255, np.uint8)
    mask[:, :60] = 0
    for name in photos[1][:3]:
        images.write(tmp_path / f"masks/{name}.png.png", mask)
    options = {"max_size_px": 240, "seed": 0, "where": "HERE"}
    views, model, _ = structure.pose_folder(
        photos[0],
        tmp_path,
        camera_model="SIMPLE_PINHOLE",
        masks=tmp_path / "masks",
        **options,
    )
    for i, name in enumerate(views.names):
        hidden = 0.25 if name in photos[1][:3] else 0.0
        assert (views.masks[i].read() < 255).mean() == pytest.approx(hidden)
    for image in model.of_colmap.images.values():
        left = min(point.xy[0] for point in image.points2D)
        assert (left >= 60) == (image.name[:-4] in photos[1][:3])


def test_errors_are_told_photo_by_photo_in_pixels_of_the_photo(photos, tmp_path):
    _, model, _ = pose_taken(photos, tmp_path, lambda i, image: (image, 1))
    seen = model.of_colmap.compute_mean_reprojection_error()
    # By then that one is of the photos too, whose sides are 1.2 times the copies'.
    assert model.mean_reprojection_error_px == pytest.approx(seen, rel=1e-3)
    assert model.errors_px.shape == (len(model.names),)
    weights = [
        sum(p.has_point3D() for p in image.points2D)
        for image in model.of_colmap.images.values()
    ]
    mean = np.average(sorted(model.errors_px), weights=sorted(weights))
    assert mean == pytest.approx(model.mean_reprojection_error_px, rel=0.2)


def test_of_many_photos_not_all_pairs_are_matched(photos, tmp_path, monkeypatch):
    monkeypatch.setattr(mapping, "MAX_EXHAUSTIVE", 3)
    monkeypatch.setattr(mapping, "FOLLOWING", 1)
    monkeypatch.setattr(mapping, "ALIKE", 3)
    found = estimate(photos, tmp_path / "a")
    assert found.names == photos[1]
    database = pycolmap.Database.open(tmp_path / "a/database.db")
    count = len(photos[1])
    assert count - 1 <= database.num_matched_image_pairs() < count * (count - 1) / 2
    database.close()
    # The same words, so the same poses.
    again = estimate(photos, tmp_path / "b")
    np.testing.assert_array_equal(again.camtoworlds, found.camtoworlds)


def test_photos_that_do_not_overlap(tmp_path):
    rng = np.random.default_rng(0)
    names = ["a", "b", "c"]
    for name in names:
        noise = rng.integers(0, 256, (12, 16, 3), dtype=np.uint8)
        images.write(tmp_path / f"{name}.png", noise.repeat(8, 0).repeat(8, 1))
    with pytest.raises(ValueError, match=r"HERE: .* registered 0 of 3 images"):
        structure.estimate_poses(tmp_path, tmp_path, [camera_of(names)], where="HERE")


def test_too_few_photos_are_named(tmp_path):
    few = [camera_of(["a"]), camera_of(["b"])]
    with pytest.raises(ValueError, match="HERE: 2 photos are too few"):
        structure.estimate_poses(tmp_path, tmp_path, few, where="HERE")
