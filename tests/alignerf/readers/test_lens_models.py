"""Every camera model of COLMAP's is undone as COLMAP itself projects by it."""

import numpy as np
import pycolmap
import pytest

from alignerf.colmap import structure
from alignerf.readers import transforms
from alignerf.scenes import distortion
from tests import camera_twins

WIDTH, HEIGHT = 96, 64
OWN = {
    "SIMPLE_RADIAL": [0.05],
    "RADIAL": [0.05, -0.03],
    "OPENCV": [0.05, -0.03, 2e-3, -1e-3],
    "FULL_OPENCV": [0.3, 0.02, 2e-3, -1e-3, 0.01, 0.2, 0.03, 4e-3],
    "SIMPLE_RADIAL_FISHEYE": [0.03],
    "RADIAL_FISHEYE": [0.03, -0.02],
    "SIMPLE_FISHEYE": [],
    "FISHEYE": [],
    "OPENCV_FISHEYE": [0.04, -0.01, 2e-3, -3e-4],
    "FOV": [0.9],
    "THIN_PRISM_FISHEYE": [0.05, -0.01, 2e-3, -1e-3, 1e-3, -1e-3, 4e-3, 3e-3],
    "RAD_TAN_THIN_PRISM_FISHEYE": [
        *(0.04, -0.01, 3e-3, -1e-3, 1e-4, -1e-4),
        *(2e-3, -1e-3, 3e-3, -2e-3, 1e-3, 2e-3),
    ],
    "SIMPLE_DIVISION": [-0.1],
    "DIVISION": [-0.1],
    "EUCM": [0.55, 1.1],
}


def camera_of(model):
    names = distortion.parameters(model)
    focal = [52.0] if "f" in names else [52.0, 53.0]
    params = [*focal, 47.3, 32.9, *OWN[model]]
    return pycolmap.Camera(model=model, width=WIDTH, height=HEIGHT, params=params)


def test_all_models_are_tried():
    told = {"INVALID", "SIMPLE_PINHOLE", "PINHOLE", "EQUIRECTANGULAR"}
    assert OWN.keys() == pycolmap.CameraModelId.__members__.keys() - told


@pytest.mark.parametrize("model", OWN)
def test_points_are_projected_as_colmap_does(model, rng):
    camera, points = camera_of(model), rng.normal(size=(300, 2)) * 0.6
    wanted = camera.img_from_cam(np.concatenate([points, np.ones((300, 1))], axis=-1))
    camtopix, own = structure.lens(model, camera.params)
    found = distortion.distort_points(points, camtopix, own)
    np.testing.assert_allclose(found, wanted, atol=1e-9)
    # Of a photo of another size, and cut by 3 px, too.
    moved = np.array([[2.0, 0, -3], [0, 2.0, 0], [0, 0, 1]])
    found = distortion.distort_points(points, moved @ camtopix, own)
    np.testing.assert_allclose(found, 2 * wanted - [3, 0], atol=1e-9)


@pytest.mark.parametrize("model", OWN)
def test_a_photo_becomes_what_the_pinhole_sees(model):
    """A smooth pattern on a far wall; COLMAP's own inverse makes the photo."""
    pixels = camera_twins.pixel_centres(WIDTH, HEIGHT)
    camera = camera_of(model)
    photo = np.rint(camera_twins.wall(camera.cam_from_img(pixels))).astype(np.uint8)
    lens = structure.lens(model, camera.params)
    pinhole = distortion.pinhole_camera(*lens, WIDTH, HEIGHT)
    found = distortion.undistort(photo.reshape(HEIGHT, WIDTH, 3), *lens, pinhole)
    inverse = np.linalg.inv(pinhole)
    wanted = camera_twins.wall(pixels @ inverse[:2, :2].T + inverse[:2, 2]).reshape(
        found.shape
    )
    # Half a pixel of error would be 3 grey levels on average.
    assert np.abs(found[2:-2, 2:-2] - wanted[2:-2, 2:-2]).mean() < 0.6


def test_maps_are_made_in_parts(monkeypatch):
    lens = structure.lens("FOV", camera_of("FOV").params)
    pinhole = distortion.pinhole_camera(*lens, WIDTH, HEIGHT)
    whole = distortion.positions(*lens, pinhole, (WIDTH, HEIGHT))
    monkeypatch.setattr(distortion, "MAX_POINTS", 5 * WIDTH)
    parts = distortion.positions(*lens, pinhole, (WIDTH, HEIGHT))
    np.testing.assert_array_equal(whole, parts)


@pytest.mark.parametrize("values", [{}, {"k5": 0.01, "k6": 4e-3}])
def test_a_transforms_json_has_the_rational_model(values):
    scene = {"camera_model": "FULL_OPENCV", "fl_x": 52.0, "w": WIDTH, "h": HEIGHT}
    scene |= {"k1": 0.3, "p1": 2e-3, "k4": 0.2, "omega": 7.0} | values
    _, found = transforms.lens_of("x: a", scene)((WIDTH, HEIGHT))
    named = {"k1": 0.3, "p1": 2e-3, "k4": 0.2} | values
    np.testing.assert_array_equal(found, distortion.of_model("FULL_OPENCV", named))
    scene["camera_model"] = "OPENCV"
    if values:
        _, same = transforms.lens_of("x: a", scene)((WIDTH, HEIGHT))
        np.testing.assert_array_equal(same, found)
    else:
        with pytest.raises(ValueError, match="x: a: distortion 'k4'"):
            transforms.lens_of("x: a", scene)((WIDTH, HEIGHT))
    scene = {"camera_model": "FOV", "fl_x": 52.0, "omega": 0.9, "w": WIDTH, "h": HEIGHT}
    _, found = transforms.lens_of("x: a", scene)((WIDTH, HEIGHT))
    np.testing.assert_array_equal(found, distortion.of_model("FOV", {"omega": 0.9}))


@pytest.mark.parametrize("model", ["EQUIRECTANGULAR", "SPHERICAL"])
def test_a_panorama_says_how(model):
    scene = {"camera_model": model, "fl_x": 52.0, "w": WIDTH, "h": HEIGHT}
    with pytest.raises(ValueError, match=r"x: a: EQUIRECTANGULAR.*cube faces"):
        transforms.lens_of("x: a", scene)((WIDTH, HEIGHT))
