"""Fisheye lenses: OpenCV's model, undone to a pinhole view."""

import json

import cv2
import numpy as np
import pycolmap
import pytest

from alignerf.colmap import structure
from alignerf.readers import transforms
from alignerf.scenes import distortion
from tests import app_cases, camera_twins

WIDTH, HEIGHT = 96, 64
CAMTOPIX = np.array([[52.0, 0, 47.3], [0, 53.0, 32.9], [0, 0, 1]])
LENSES = [np.zeros(4), np.array([0.04, -0.01, 2e-3, -3e-4]), np.full(4, -5e-3)]
OPENCV = CAMTOPIX - np.array([[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]])


@pytest.mark.parametrize("lens", LENSES)
def test_points_agree_with_opencv(lens, rng):
    points = np.concatenate([rng.normal(size=(300, 2)) * 0.8, np.zeros((1, 2))])
    wanted = cv2.fisheye.distortPoints(points[:, None], OPENCV, lens)[:, 0] + 0.5
    found = distortion.distort_points(points, CAMTOPIX, lens)
    np.testing.assert_allclose(found, wanted, atol=1e-9)


@pytest.mark.parametrize("lens", LENSES)
def test_the_view_fits_tightly_inside_the_photo(lens):
    pinhole = distortion.pinhole_camera(CAMTOPIX, lens, WIDTH, HEIGHT)
    inverse, slack = np.linalg.inv(pinhole), []
    assert pinhole[0, 0] / pinhole[1, 1] == pytest.approx(52 / 53)
    for side in distortion._border(WIDTH, HEIGHT):
        points = side @ inverse[:2, :2].T + inverse[:2, 2]
        pixels = distortion.distort_points(points, CAMTOPIX, lens)
        room = np.concatenate([pixels, [WIDTH, HEIGHT] - pixels], axis=-1)
        slack.append(room.min() - 0.5)
    assert min(slack) > -0.05
    assert min(slack) < 0.2


@pytest.mark.parametrize("lens", LENSES)
def test_the_undistorted_photo_is_what_the_pinhole_sees(lens):
    """A smooth pattern on a far wall; OpenCV's own inverse makes the photo."""
    pixels = camera_twins.pixel_centres(WIDTH, HEIGHT)
    seen = cv2.fisheye.undistortPoints(pixels[:, None] - 0.5, OPENCV, lens)[:, 0]
    photo = np.rint(camera_twins.wall(seen)).astype(np.uint8).reshape(HEIGHT, WIDTH, 3)
    pinhole = distortion.pinhole_camera(CAMTOPIX, lens, WIDTH, HEIGHT)
    found = distortion.undistort(photo, CAMTOPIX, lens, pinhole)
    inverse = np.linalg.inv(pinhole)
    wanted = camera_twins.wall(pixels @ inverse[:2, :2].T + inverse[:2, 2])
    wanted = wanted.reshape(found.shape)
    # Half a pixel of error would be 3 grey levels on average.
    assert np.abs(found[2:-2, 2:-2] - wanted[2:-2, 2:-2]).mean() < 0.6


def test_what_no_pinhole_shows_is_refused():
    with pytest.raises(ValueError, match=r"folds the image: the estimate .* is wild"):
        distortion.pinhole_camera(CAMTOPIX, np.array([-0.9, 0, 0, 0]), WIDTH, HEIGHT)


@pytest.mark.parametrize("k1", [0.0, -0.03])
def test_of_half_a_sphere_the_middle_is_seen(k1):
    """Beyond the image's circle a lens may fold: no view reaches there."""
    focal_px = WIDTH / np.pi
    camtopix = np.array([[focal_px, 0, WIDTH / 2], [0, focal_px, WIDTH / 2], [0, 0, 1]])
    lens = np.array([k1, 0, 0, -1e-3])
    pinhole = distortion.pinhole_camera(camtopix, lens, WIDTH, WIDTH)
    degrees = np.degrees(np.arctan(WIDTH / 2 / pinhole[0, 0]))
    assert 60 < degrees < 66
    at = distortion.positions(camtopix, lens, pinhole, (WIDTH, WIDTH))
    assert np.min(at) > 0
    assert np.max(at) < WIDTH - 1


@pytest.mark.parametrize("key", ["camera_model", "is_fisheye"])
def test_a_transforms_json_may_be_of_a_fisheye(tmp_path, rng, key):
    content = {"fl_x": 52.0, "fl_y": 53.0, "cx": 47.3, "cy": 32.9, "frames": []}
    content |= {"k1": 0.04, "k2": -0.01, "k3": 2e-3, "k4": -3e-4}
    content[key] = "OPENCV_FISHEYE" if key == "camera_model" else True
    for i, pose in enumerate(app_cases.camtoworlds(rng, 2)):
        app_cases.write_photo(tmp_path / f"images/{i}.png", size=(WIDTH, HEIGHT))
        matrix = [*pose.tolist(), [0, 0, 0, 1]]
        content["frames"] += [{"file_path": f"images/{i}", "transform_matrix": matrix}]
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(content))
    views, _ = transforms.read(tmp_path)
    wanted = distortion.pinhole_camera(CAMTOPIX, LENSES[1], WIDTH, HEIGHT)
    np.testing.assert_allclose(np.linalg.inv(views.pixtocams[1]), wanted, atol=1e-9)
    assert views.photos[1].read().shape == (HEIGHT, WIDTH, 3)
    path.write_text(json.dumps(content | {"p1": 0.01}))
    with pytest.raises(ValueError, match="distortion 'p1'"):
        transforms.read(tmp_path)


def test_colmaps_fisheye_is_the_same(rng):
    """COLMAP projects points where we do."""
    params = np.array([52.0, 53.0, 47.3, 32.9, *LENSES[1]])
    camera = pycolmap.Camera(
        model="OPENCV_FISHEYE", width=WIDTH, height=HEIGHT, params=params, camera_id=1
    )
    points = rng.normal(size=(100, 2)) * 0.5
    space = np.concatenate([points, np.ones((100, 1))], axis=-1)
    found = distortion.distort_points(points, *structure.lens("OPENCV_FISHEYE", params))
    np.testing.assert_allclose(found, camera.img_from_cam(space), atol=1e-6)
