"""flow.camera.motion: motions one after the other, and the slope of a motion's flow."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras
from flow.camera import motion as camera_motion
from tests import camera_twins

WIDTH, HEIGHT, FOCAL_PX = 64, 48, 55.0
PIXTOCAM = cameras.intrinsics(FOCAL_PX, WIDTH, HEIGHT)


def random_motion(rng, size):
    turn, step = rng.normal(size=(2, 3)) * size
    return camera_motion.Motion(turn, step, rng.normal() * size)


def random_camera(rng):
    turn = Rotation.random(rng=rng.integers(2**31)).as_matrix()
    return PIXTOCAM, np.concatenate([turn, rng.normal(size=(3, 1))], axis=-1)


def points_of(rng, count=40):
    """Rays all over the image; depths from near to none."""
    at = rng.uniform(size=(count, 2)) * (WIDTH, HEIGHT)
    rays = np.concatenate([at, np.ones((count, 1))], axis=-1) @ PIXTOCAM.T
    rho = rng.uniform(0, 0.8, count)
    rho[:5] = 0.0
    return camera_motion.Points(rays, rho, np.linalg.inv(PIXTOCAM))


@pytest.mark.parametrize("size", [1e-6, 0.03, 0.5])
def test_a_further_change_is_one_motion_after_the_other(rng, size):
    """Of `moved`: a turn, a step and a zoom in the moved camera's own axes."""
    for _ in range(20):
        camera, first, change = (
            random_camera(rng),
            random_motion(rng, size),
            random_motion(rng, size),
        )
        both = camera_motion.moved(first, np.concatenate([*change[:2], [change[2]]]))
        at_once = camera_motion.apply(both, *camera)
        one_by_one = camera_motion.apply(change, *camera_motion.apply(first, *camera))
        for found, wanted in zip(at_once, one_by_one, strict=True):
            np.testing.assert_allclose(found, wanted, atol=1e-12)
        # And as the difference of the two cameras.
        found = camera_motion.between(camera, one_by_one)
        for own, wanted in zip(found, both, strict=True):
            np.testing.assert_allclose(own, wanted, atol=1e-11)


@pytest.mark.parametrize("size", [0.0, 1e-4, 0.1])
def test_the_jacobian_is_the_slope_of_the_flow(rng, size):
    """Against central differences of `flow` after a further change, in all seven."""
    motion, points = random_motion(rng, size), points_of(rng)
    found = camera_motion.jacobian(motion, points)
    step = 1e-5
    for place in range(7):
        change = step * np.eye(7)[place]
        slope = camera_motion.flow(camera_motion.moved(motion, change), points)
        slope -= camera_motion.flow(camera_motion.moved(motion, -change), points)
        np.testing.assert_allclose(found[..., place], slope / (2 * step), atol=1e-5)


def test_small_motions_are_their_parameters(rng):
    """[turn, step along the turned axes, zoom]: what `moved` adds to no motion."""
    size = 1e-6
    motion = random_motion(rng, size)
    again = camera_motion.moved(camera_motion.STILL, camera_motion.parameters(motion))
    for own, wanted in zip(again, motion, strict=True):
        np.testing.assert_allclose(own, wanted, atol=10 * size**2)


def test_axes_are_opencvs_in_motions_and_opengls_in_poses():
    """A camera that turns to its right, then steps down: by hand."""
    pose = np.eye(4)[:3]
    motion = camera_motion.Motion(np.array([0, np.pi / 2, 0]), np.array([0, 2.0, 0]), 0)
    _, moved = camera_motion.apply(motion, PIXTOCAM, pose)
    # OpenGL: x right, y up, so that down is -y; it looked along -z, now along +x.
    np.testing.assert_allclose(-moved[:, 2], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(moved[:, 1], [0, 1, 0], atol=1e-12)
    np.testing.assert_allclose(moved[:, 3], [0, -2, 0], atol=1e-12)
    # What it sees goes to the left when it turns right, and up when it steps down.
    small = camera_motion.Motion(np.array([0, 0.01, 0]), np.array([0, 0.02, 0]), 0)
    flow = camera_motion.flow(
        small, camera_motion.points_of(PIXTOCAM, np.full((HEIGHT, WIDTH), 2.0))
    )
    assert (flow[..., 0] < 0).all()
    assert (flow[..., 1] < 0).all()
    camera = PIXTOCAM, pose
    moved = camera_motion.apply(small, *camera)
    wanted = camera_twins.reprojection_flow(
        np.full((HEIGHT, WIDTH), 2.0), camera, moved
    )
    np.testing.assert_allclose(flow, wanted, atol=1e-9)
