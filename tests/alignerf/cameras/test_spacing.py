"""From how far aside photos see what held-out ones see."""

import math

import numpy as np
import pytest

from alignerf.cameras import exposure, spacing
from alignerf.scenes import cameras

SIZE, FOCAL, DISTANCE = (40, 30), 40.0, 5.0
PIXTOCAM = np.linalg.inv(
    [[FOCAL, 0, SIZE[0] / 2], [0, FOCAL, SIZE[1] / 2], [0, 0, 1.0]]
)


def view(degrees, depth=None):
    """A camera on a circle around a small ball, which it sees in its middle."""
    turn = np.deg2rad(degrees)
    axes = np.array(
        [
            [np.cos(turn), 0, np.sin(turn)],
            [0, 1.0, 0],
            [-np.sin(turn), 0, np.cos(turn)],
        ]
    )
    pose = np.concatenate([axes, DISTANCE * axes[:, 2:]], axis=1)
    photo = np.full((*SIZE[::-1], 3), 120, np.uint8)
    known = np.full(SIZE[::-1], np.nan)
    known[13:17, 18:22] = DISTANCE if depth is None else depth
    return exposure.sampled(exposure.View(photo, known, PIXTOCAM, pose))


def test_cameras_look_at_the_middle():
    pixel, depth = cameras.project(np.zeros((1, 3)), PIXTOCAM, view(40).camtoworld)
    np.testing.assert_allclose(pixel[0], np.array(SIZE) / 2, atol=1e-9)
    assert depth == pytest.approx(DISTANCE)


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_third_nearest_photo_that_sees_the_points(seed):
    rng = np.random.default_rng(seed)
    held_out, learnt = rng.uniform(0, 50, 3), rng.uniform(0, 50, 8)
    wanted = np.median([np.sort(np.abs(learnt - one))[2] for one in held_out])
    found = spacing.degrees([*map(view, held_out)], [*map(view, learnt)])
    assert found == pytest.approx(wanted, abs=2.5)
    # What hides the points, or stands behind the photo, sees nothing.
    hidden = [view(one, depth=0.5 * DISTANCE) for one in held_out]
    again = spacing.degrees([*map(view, held_out)], [*map(view, learnt), *hidden])
    assert again == pytest.approx(found, abs=1e-6)


def test_too_few_photos_and_unknown_depth():
    one = view(0)
    assert spacing.degrees([one], [view(3), view(6)]) == math.inf
    assert spacing.degrees([one], []) == math.inf
    assert math.isnan(spacing.degrees([], [one]))
    assert math.isnan(spacing.degrees([view(0, depth=np.nan)], [one] * 4))
