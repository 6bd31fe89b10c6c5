"""flow.camera.correct: motions that can be trusted, and a lens that views share."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras
from flow.camera import correct
from flow.camera import motion as camera_motion
from tests import camera_twins

WIDTH, HEIGHT, FOCAL_PX = 64, 48, 55.0
PIXTOCAM = cameras.intrinsics(FOCAL_PX, WIDTH, HEIGHT)


def random_motion(rng, size_px, log_focal=0.0):
    """A turn and a step, each of about size_px at depth 2."""
    turn, step = rng.normal(size=(2, 3)) * size_px / FOCAL_PX
    return camera_motion.Motion(turn, step, log_focal)


def random_camera(rng):
    turn = Rotation.random(rng=rng.integers(2**31)).as_matrix()
    return PIXTOCAM, np.concatenate([turn, rng.normal(size=(3, 1))], axis=-1)


def view_of(rng, motion, noise_px=0.0):
    """A view whose photo was taken by the moved camera, by way of world points."""
    y = np.indices((HEIGHT, WIDTH))[0]
    depth = np.minimum(1 / np.maximum((y - 12) / 40, 0.05), 9.0)
    depth[20:40, 10:20], depth[15:35, 40:52] = 1.2, 2.0
    camera = random_camera(rng)
    moved = camera_motion.apply(motion, *camera)
    flow_px = camera_twins.reprojection_flow(depth, camera, moved)
    flow_px += noise_px * rng.normal(size=flow_px.shape)
    valid = np.ones((HEIGHT, WIDTH), bool)
    return correct.View(flow_px, valid, PIXTOCAM, depth)


def given(views):
    """What gives each view when it is asked."""
    return [lambda view=view: view for view in views]


def test_a_motion_takes_one_camera_to_another(rng):
    for size_px in (0.1, 3.0, 30.0):
        motion = random_motion(rng, size_px, 0.01 * size_px)
        camera = random_camera(rng)
        moved = camera_motion.apply(motion, *camera)
        found = camera_motion.between(camera, moved)
        for ours, true in zip(found, motion, strict=True):
            np.testing.assert_allclose(ours, true, atol=1e-12)
        # And back.
        back = camera_motion.apply(camera_motion.between(moved, camera), *moved)
        for ours, true in zip(back, camera, strict=True):
            np.testing.assert_allclose(ours, true, atol=1e-12)
    assert camera_motion.apply(camera_motion.STILL, *camera)[1] == pytest.approx(
        camera[1], abs=0
    )


@pytest.mark.parametrize("size_px", [0.2, 1.5, 6.0])
def test_each_view_is_found_back(rng, size_px):
    motions = [random_motion(rng, size_px) for _ in range(5)]
    views = [view_of(rng, motion, noise_px=0.1) for motion in motions]
    found = correct.corrections(given(views))
    for view, motion, correction in zip(views, motions, found, strict=True):
        assert correction.left_alone == ""
        assert correction.noise_px == pytest.approx(0.1, rel=0.15)
        points = camera_motion.points_of(PIXTOCAM, view.depth)
        ours, true = (
            camera_motion.flow(m, points) for m in (correction.motion, motion)
        )
        length_px = np.median(np.linalg.norm(true, axis=-1))
        assert correction.length_px == pytest.approx(length_px, rel=0.05, abs=0.02)
        error = np.linalg.norm(ours - true, axis=-1)
        assert np.median(error) < 0.05 * length_px + 0.01


def test_a_view_that_cannot_be_trusted_stays_and_says_why(rng):
    views = [view_of(rng, random_motion(rng, 0.3), noise_px=0.1) for _ in range(8)]
    few = np.zeros((HEIGHT, WIDTH), bool)
    few[:4, :4] = True
    views[1] = views[1]._replace(valid=few)
    few = few.copy()
    few[:10, :10] = True
    views[2] = views[2]._replace(valid=few)
    wild = 20 * rng.normal(size=views[3].flow_px.shape)
    views[3] = views[3]._replace(flow_px=wild)
    views[4] = view_of(rng, random_motion(rng, 30.0), noise_px=0.1)
    views[5] = views[5]._replace(depth=np.full((HEIGHT, WIDTH), np.nan))
    found = correct.corrections(given(views))
    reasons = {
        1: "only 16 pixels",
        2: "only 3.3% of its pixels",
        3: "no camera explains its flow",
        4: "it would move by",
        5: "only 0 pixels",
    }
    for number, correction in enumerate(found):
        assert correction.left_alone.startswith(reasons.get(number, ""))
        assert bool(correction.left_alone) == (number in reasons)
        if number in reasons:
            assert correction.motion is camera_motion.STILL
            assert correction.length_px == 0
        else:
            assert correction.length_px > 0.05


def test_motions_as_short_as_a_flows_error_move_no_camera(rng):
    """With true poses flows ask for 0.05 to 0.08 px, which harms the next round."""
    for size_px, stay in ((0.02, True), (0.3, False)):
        views = [view_of(rng, random_motion(rng, size_px)) for _ in range(8)]
        for correction in correct.corrections(given(views)):
            assert bool(correction.left_alone) == stay
            if stay:
                assert "that is the flow's error" in correction.left_alone
                assert correction.motion is camera_motion.STILL
                assert correction.length_px == 0


def test_one_camera_that_is_off_moves_alone(rng):
    motion = camera_motion.Motion(*np.array([[0.02, -0.02, 0], [0.01, 0, 0]]), 0.0)
    views = [view_of(rng, random_motion(rng, 0.02)) for _ in range(7)]
    views.insert(3, view_of(rng, motion))
    found = correct.corrections(given(views))
    assert [bool(correction.left_alone) for correction in found] == [
        number != 3 for number in range(8)
    ]
    for ours, true in zip(found[3].motion, motion, strict=True):
        np.testing.assert_allclose(ours, true, atol=2e-3)


def test_one_view_alone_is_found_too(rng):
    (found,) = correct.corrections(given([view_of(rng, random_motion(rng, 1))]))
    assert found.left_alone == ""
    assert found.motion.log_focal == 0


def test_a_lens_that_all_views_share_is_found(rng):
    motions = [random_motion(rng, 0.5, log_focal=0.02) for _ in range(8)]
    views = [view_of(rng, motion, noise_px=0.1) for motion in motions]
    found = correct.corrections(given(views))
    zooms = {correction.motion.log_focal for correction in found}
    assert len(zooms) == 1
    assert zooms.pop() == pytest.approx(0.02, rel=0.05)


def test_zooms_that_differ_are_no_lens(rng):
    zooms = [0.004, -0.003, 0.002, -0.005, 0.001, 0.0]
    motions = [random_motion(rng, 0.5, log_focal=zoom) for zoom in zooms]
    views = [view_of(rng, motion, noise_px=0.1) for motion in motions]
    found = correct.corrections(given(views))
    assert all(correction.motion.log_focal == 0 for correction in found)


def test_objects_that_move_do_not_drag_a_camera(rng):
    """Nothing but objects on a fifth of each view moves: the cameras stay."""
    views = []
    for _ in range(6):
        view = view_of(rng, camera_motion.STILL, noise_px=0.1)
        view.flow_px[10:30, 20:50] += rng.normal(size=2) * 3
        views.append(view)
    for correction in correct.corrections(given(views)):
        assert correction.length_px < 0.05
