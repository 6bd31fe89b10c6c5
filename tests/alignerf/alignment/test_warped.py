"""What a photo is warped by: what moves by itself, and nothing else."""

import numpy as np
import pytest

from alignerf.alignment import warped
from alignerf.scenes import cameras
from flow.camera import correct
from flow.camera import fit as camera_fit
from flow.camera import motion as camera_motion


def flow_view(motion, depth=None):
    """What a small view says of a camera that moved like this, and of nothing else."""
    depth = np.full((48, 60), 2.0) if depth is None else depth
    pixtocam = cameras.intrinsics(50.0, 60, 48)
    points = camera_motion.points_of(pixtocam, depth)
    flow_px = camera_motion.flow(motion, points).astype(np.float32)
    return correct.View(flow_px, np.ones(depth.shape, bool), pixtocam, depth)


def correction(motion, **changes):
    found = correct.Correction(motion, 1.0, 0.02, 1.0, 2.0, "")
    return found._replace(**changes)


TURN = camera_motion.Motion(np.array([0.01, 0.02, 0.0]), np.zeros(3), 0.01)


def test_what_a_camera_explains_is_not_warped():
    """Whether it has been put right or not."""
    view = flow_view(TURN)
    for moved in (correction(TURN), None):
        offset = warped.offsets(view, moved, max_pixels=1000)
        assert np.abs(offset).max() < 0.02


def test_a_flow_that_no_camera_explains_warps_no_photo(rng):
    view = flow_view(TURN)._replace(
        flow_px=rng.normal(size=(48, 60, 2)).astype(np.float32) * 5
    )
    refused = correct.corrections([lambda: view, *[lambda: flow_view(TURN)] * 4])
    assert not refused[0].trusted
    assert all(one.trusted for one in refused[1:])
    offset = warped.offsets(view, refused[0], max_pixels=1000)
    assert not offset.any()


@pytest.mark.parametrize("fill", [np.nan, np.inf, 0.0])
def test_depths_that_are_none_are_no_part_of_a_fit(fill):
    """Far away is a depth; none is not. All stays finite."""
    depth = np.full((48, 60), 2.0)
    depth[:20] = fill
    view = flow_view(TURN, depth=np.full((48, 60), 2.0))._replace(depth=depth)
    (found,) = correct.corrections([lambda: view], zooms=False)
    assert np.isfinite(found.length_px)
    offset = warped.offsets(view, found, max_pixels=1000)
    assert np.isfinite(offset).all()


@pytest.mark.parametrize(("longest_px", "is_warped"), [(0.45, False), (0.6, True)])
def test_a_region_moves_where_some_part_of_it_clearly_does(longest_px, is_warped):
    """A hill of motion: warped down to its foot, or not at all.

    A short flow elsewhere never is, nor is a long one that is not valid.
    """
    y, x = np.mgrid[:48, :60]
    hill_px = longest_px * np.exp(-((x - 30) ** 2 + (y - 24) ** 2) / 60)
    hill_px[5, 5] = 0.3
    valid = np.ones(hill_px.shape, bool)
    valid[40:44, 4:9] = False
    hill_px[~valid] = 3.0
    flow_px = np.stack([hill_px, np.zeros_like(hill_px)], axis=-1).astype(np.float32)
    view = flow_view(camera_motion.STILL)._replace(flow_px=flow_px, valid=valid)
    fit = camera_fit.split(*view)
    moves = warped.moving(fit)
    assert moves.any() == is_warped
    if is_warped:
        near = np.linalg.norm(fit.remainder_px, axis=-1) > warped.MIN_MOVE_PX
        near[5, 5] = False
        np.testing.assert_array_equal(moves, near & fit.moved)
