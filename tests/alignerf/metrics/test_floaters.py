"""What hides a view is near, and not in the photo."""

import math

import numpy as np
import pytest

from alignerf.metrics import floaters
from tests import judged_cases

PHOTO = judged_cases.picture(5, (96, 72))
DEPTH = np.linspace(4.0, 9.0, 72)[:, None] * np.ones((72, 96))
EVERYWHERE = np.ones((72, 96), bool)


def hidden(*, colour=255, depth=0.3, render=PHOTO, counts=EVERYWHERE):
    render, depths = render.copy(), DEPTH.copy()
    render[20:50, 30:70], depths[20:50, 30:70] = colour, depth
    return floaters.hidden(PHOTO, render, depths, counts)


def test_a_floater_is_near_and_other_than_the_photo():
    covered = 30 * 40 / (72 * 96)
    assert hidden() == pytest.approx(covered, rel=0.3)
    # What is wrong at the scene's own depth is no floater; a near thing that the photo
    # shows is one of the scene.
    assert hidden(depth=5.0) == 0
    right = np.where(EVERYWHERE[..., None], PHOTO, 0)
    depths = np.where(np.arange(96) < 30, 0.3, DEPTH)
    assert floaters.hidden(PHOTO, right, depths, EVERYWHERE) == 0
    # What does not count is none either.
    counts = EVERYWHERE.copy()
    counts[15:55, 25:75] = False
    assert hidden(counts=counts) == 0


def test_without_depth_nothing_is_known():
    for depth in (np.zeros_like(DEPTH), np.full_like(DEPTH, np.nan)):
        assert math.isnan(floaters.hidden(PHOTO, PHOTO, depth, EVERYWHERE))
    assert math.isnan(hidden(counts=~EVERYWHERE))
    # All of it is wrong: nothing says how far the scene is.
    white = np.full_like(PHOTO, 255)
    assert math.isnan(floaters.hidden(white * 0, white, DEPTH, EVERYWHERE))
