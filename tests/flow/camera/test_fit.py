"""flow.camera.fit: exact for finite motions, robust, and finite on any input."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras
from flow.camera import fit as camera_fit
from flow.camera import motion as camera_motion

SIZE = WIDTH, HEIGHT = 64, 48
FOCAL_PX = 55.0
PIXTOCAM = cameras.intrinsics(FOCAL_PX, *SIZE)


@pytest.fixture
def depth(rng):
    """A floor that leads away, a wall, and posts before it, with some sky."""
    y = np.indices((HEIGHT, WIDTH))[0]
    found = np.minimum(1 / np.maximum((y - 12) / 40, 0.05), 9.0)
    found[20:40, 10:20] = 1.2
    found[15:35, 40:52] = 2.0
    found[:6] = np.inf
    return found


@pytest.fixture
def valid():
    return np.ones((HEIGHT, WIDTH), bool)


def random_motion(rng, size_px=4.0):
    """A motion whose parts each move a point at depth 2 by some pixels."""
    return camera_motion.Motion(
        rotation=rng.normal(size=3) * size_px / FOCAL_PX,
        centre=rng.normal(size=3) * size_px / FOCAL_PX,
        log_focal=rng.normal() * size_px / (WIDTH / 2),
    )


def reprojected(motion, depth):
    """The same flow by way of points in the world and two posed cameras."""
    y, x = np.indices((HEIGHT, WIDTH))
    pose = np.random.default_rng(5).normal(size=(3, 4))
    pose[:, :3] = Rotation.random(rng=3).as_matrix()
    rays = cameras.pixels_to_rays(x, y, PIXTOCAM, pose)
    points = rays.origins + np.minimum(depth, 1e9)[..., None] * rays.directions
    # Camera axes of cameras.py are OpenGL's, those of a Motion OpenCV's.
    flip = cameras.OPENGL_FROM_OPENCV
    turn = flip @ Rotation.from_rotvec(motion.rotation).as_matrix() @ flip
    moved = pose.copy()
    moved[:, :3] = pose[:, :3] @ turn
    moved[:, 3] += pose[:, :3] @ flip @ motion.centre
    pixtocam = cameras.intrinsics(FOCAL_PX * np.exp(motion.log_focal), *SIZE)
    at, front = cameras.project(points, pixtocam, moved)
    assert (front > 0).all()
    return at - np.stack([x + 0.5, y + 0.5], axis=-1)


def longest(vectors):
    return np.linalg.norm(vectors, axis=-1).max()


def test_flow_of_a_camera_is_that_of_exact_reprojection(rng, depth):
    for _ in range(10):
        motion = random_motion(rng, 4.0)
        wanted = reprojected(motion, depth)
        assert longest(wanted) > 3
        found = camera_motion.flow(motion, camera_motion.points_of(PIXTOCAM, depth))
        np.testing.assert_allclose(found, wanted, atol=1e-6)


@pytest.mark.parametrize("size_px", [0.1, 1.0, 4.0])
def test_finite_motions_are_recovered_exactly(rng, depth, valid, size_px):
    for _ in range(5):
        motion = random_motion(rng, size_px)
        flow_px = reprojected(motion, depth)
        found = camera_fit.split(flow_px, valid, PIXTOCAM, depth)
        assert longest(found.remainder_px) < 2e-3 * size_px
        assert not found.moved.any()
        np.testing.assert_allclose(
            found.camera_px + found.remainder_px, flow_px, atol=1e-5
        )
        scale = size_px / FOCAL_PX
        for ours, true in zip(found.motion, motion, strict=True):
            np.testing.assert_allclose(ours, true, atol=0.01 * scale)


def test_what_moves_otherwise_is_left_out(rng, depth, valid):
    """A third of the image moves on its own, all in one direction."""
    motion = random_motion(rng, 1.5)
    camera_px = reprojected(motion, depth)
    flow_px = camera_px.copy()
    own = np.zeros_like(valid)
    own[15:46, 8:40] = True
    assert own.mean() > 0.3
    flow_px[own] += [2.0, -1.0]
    found = camera_fit.split(flow_px, valid, PIXTOCAM, depth)
    np.testing.assert_allclose(found.camera_px, camera_px, atol=0.02)
    np.testing.assert_array_equal(found.moved, own)


def test_noise_is_measured_and_averaged_out(rng, depth, valid):
    motion = random_motion(rng, 1.5)
    camera_px = reprojected(motion, depth)
    noise = rng.normal(size=camera_px.shape) * 0.3
    found = camera_fit.split(camera_px + noise, valid, PIXTOCAM, depth)
    assert found.noise_px == pytest.approx(0.3, rel=0.1)
    error = np.linalg.norm(found.camera_px - camera_px, axis=-1)
    assert error.mean() < 0.05
    # Of a two-dimensional normal error, 1.1 % is longer than three deviations.
    assert 0.003 < found.moved.mean() < 0.03


def test_the_unit_of_depth_is_the_unit_of_the_centre(rng, depth, valid):
    flow_px = reprojected(random_motion(rng), depth)
    one, ten = (
        camera_fit.split(flow_px, valid, PIXTOCAM, scale * depth) for scale in (1, 10)
    )
    np.testing.assert_allclose(10 * one.motion.centre, ten.motion.centre, rtol=1e-6)
    np.testing.assert_allclose(one.camera_px, ten.camera_px, atol=1e-5)


def test_invalid_pixels_say_nothing(rng, depth, valid):
    flow_px = reprojected(random_motion(rng), depth)
    bad = rng.random(valid.shape) < 0.6
    wild = np.where(bad[..., None], 500.0, flow_px)
    for options in (
        {"valid": ~bad},
        {"valid": valid, "depth": np.where(bad, np.nan, depth)},
        {"valid": valid, "depth": np.where(bad, 0.0, depth)},
    ):
        options = {"depth": depth} | options
        found = camera_fit.split(wild, pixtocam=PIXTOCAM, **options)
        assert longest(found.remainder_px[~bad & (depth < np.inf)]) < 0.02


def test_without_depth_a_turn_and_a_zoom_are_found(valid):
    turned = camera_motion.Motion(np.array([0.01, -0.02, 0.005]), np.zeros(3), 0.01)
    far = np.full(valid.shape, np.inf)
    flow_px = reprojected(turned, far)
    for depth in (None, far, np.full(valid.shape, 1e12)):
        found = camera_fit.split(flow_px, valid, PIXTOCAM, depth)
        assert longest(found.remainder_px) < 1e-3
        np.testing.assert_allclose(found.motion.rotation, turned.rotation, atol=1e-5)
        assert found.motion.log_focal == pytest.approx(0.01, rel=1e-2)
    assert not camera_fit.split(flow_px, valid, PIXTOCAM).motion.centre.any()


def test_no_flow_is_no_motion(depth, valid):
    found = camera_fit.split(np.zeros((*valid.shape, 2)), valid, PIXTOCAM, depth)
    assert not found.camera_px.any()
    assert not found.moved.any()
    assert found.noise_px == 0
    for values in found.motion:
        assert not np.any(values)


def test_what_looks_like_a_turn_is_one(rng, valid):
    """Forward-facing and flat: turn and sidestep differ by less than the noise."""
    pixtocam = cameras.intrinsics(50 * FOCAL_PX, *SIZE)
    depth = np.full(valid.shape, 5.0)
    step = camera_motion.Motion(np.zeros(3), np.array([0.0036, 0, 0]), 0.0)
    camera_px = camera_motion.flow(step, camera_motion.points_of(pixtocam, depth))
    assert longest(camera_px) == pytest.approx(1.98, abs=0.01)
    noise = rng.normal(size=camera_px.shape) * 0.2
    found = camera_fit.split(camera_px + noise, valid, pixtocam, depth)
    np.testing.assert_allclose(found.camera_px, camera_px, atol=0.05)
    # Of 2 px at most a tenth is given to steps, and nothing blows up.
    assert np.abs(found.motion.centre).max() < 0.1 * 0.0036
    assert found.motion.rotation[1] == pytest.approx(2 / (50 * FOCAL_PX), rel=0.1)


@pytest.mark.parametrize("pixels", [0, 1, 7, camera_fit.MIN_PIXELS - 1])
def test_of_too_few_pixels_the_camera_stays(rng, depth, pixels):
    valid = np.zeros((HEIGHT, WIDTH), bool)
    valid.ravel()[rng.permutation(valid.size)[:pixels]] = True
    flow_px = rng.normal(size=(HEIGHT, WIDTH, 2))
    found = camera_fit.split(flow_px, valid, PIXTOCAM, depth)
    assert found.pixels == 0
    assert not found.camera_px.any()
    np.testing.assert_allclose(found.remainder_px, flow_px, rtol=1e-6)


@pytest.mark.parametrize("length_px", [1e-30, 1e-3, 1e3, 1e6])
@pytest.mark.parametrize("kind", ["noise", "constant"])
@pytest.mark.parametrize("distance", [1e-9, 1.0, 1e12])
def test_any_input_gives_finite_output(rng, valid, length_px, kind, distance):
    flow_px = length_px * rng.normal(size=(*valid.shape, 2))
    if kind == "constant":
        flow_px = np.full_like(flow_px, length_px)
    depth = distance * rng.uniform(0.5, 2, valid.shape)
    found = camera_fit.split(flow_px, valid, PIXTOCAM, depth)
    for values in (*found.motion, found.camera_px, found.remainder_px, found.noise_px):
        assert np.isfinite(values).all()


@pytest.mark.parametrize("shape", [(1, 1), (1, 200), (200, 1), (9, 9)])
def test_thin_images(rng, shape):
    flow_px = rng.normal(size=(*shape, 2))
    found = camera_fit.split(flow_px, np.ones(shape, bool), PIXTOCAM, np.ones(shape))
    assert np.isfinite(found.camera_px).all()
    assert all(np.isfinite(values).all() for values in found.motion)


def test_large_images_are_sampled(rng):
    shape = (600, 800)
    pixtocam = cameras.intrinsics(700.0, 800, 600)
    depth = rng.uniform(1, 3, shape)
    motion = camera_motion.Motion(np.array([0.002, 0, 0]), np.array([0, 0.01, 0]), 0.0)
    flow_px = camera_motion.flow(motion, camera_motion.points_of(pixtocam, depth))
    found = camera_fit.split(flow_px, np.ones(shape, bool), pixtocam, depth)
    assert 5_000 < found.pixels <= camera_fit.MAX_PIXELS
    assert longest(found.remainder_px) < 0.005


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"pixtocam": np.zeros((3, 3))}, "singular"),
        ({"pixtocam": np.full((3, 3), np.nan)}, "pixtocam"),
        ({"depth": np.ones((3, 4))}, "depth"),
        ({"flow_px": np.zeros((4, 4, 2))}, "flow"),
    ],
)
def test_input_that_does_not_fit_is_refused(valid, change, reason):
    options = {"flow_px": np.zeros((HEIGHT, WIDTH, 2)), "valid": valid}
    with pytest.raises(ValueError, match=reason):
        camera_fit.split(**{"pixtocam": PIXTOCAM} | options | change)
