"""Fisheye lenses: OpenCV's model, undone to a pinhole view."""

import json

import numpy as np
import pytest

from alignerf.readers import transforms
from alignerf.scenes import distortion
from tests import app_cases

WIDTH, HEIGHT = 96, 64
CAMTOPIX = np.array([[52.0, 0, 47.3], [0, 53.0, 32.9], [0, 0, 1]])
LENSES = [np.zeros(4), np.array([0.04, -0.01, 2e-3, -3e-4]), np.full(4, -5e-3)]


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
