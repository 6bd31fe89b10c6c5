"""Who judges corrections: held-out matches, by view, beyond chance."""

import numpy as np
import pytest

from alignerf.sfm import acceptance, mistakes
from tests.alignerf.sfm import made


def test_better_cameras_are_accepted_and_worse_ones_refused(rng):
    true = made.cameras()
    wrong, found = made.perturbed(true, 3.0, rng), made.matched(true, rng)
    better = acceptance.judge(found, wrong, true)
    assert better.accepted
    assert better.halved
    assert not better.worse
    worse = acceptance.judge(found, true, wrong)
    assert worse.worse
    assert not worse.accepted
    assert not worse.halved
    assert worse.gain_px == pytest.approx(-better.gain_px)
    same = acceptance.judge(found, true, true)
    assert not same.accepted
    assert not same.worse
    assert same.gain_px == 0


def test_the_photo_decides_how_much_is_enough(rng):
    """A gain of 0.03 px in images of a quarter of the photo's size is 0.12 px."""
    true = made.cameras()
    wrong, found = made.perturbed(true, 0.3, rng), made.matched(true, rng, points=3000)
    small, large = (acceptance.judge(found, wrong, true, px) for px in (0.05, 4.0))
    assert not small.accepted
    assert large.accepted
    assert large.gain_px == pytest.approx(80 * small.gain_px)


def test_without_held_out_matches_nothing_is_accepted(rng):
    true = made.cameras()
    found = made.matched(true, rng, unseen=range(12))
    told = acceptance.judge(found, made.perturbed(true, 9.0, rng), true).told()
    assert told["before_px"] is None
    assert not told["accepted"]
    assert not told["worse"]


def test_views_and_lenses_that_stand_out_are_named():
    names = [f"v{k}" for k in range(9)]
    poses = made.orbit(9)
    px = np.full(9, 0.4)
    assert mistakes.of_views(names, px, poses) == {}
    px[3] = 9.0
    poses[[5, 6]] = np.eye(4)[:3]
    poses[8] = poses[0]
    found = mistakes.of_views(names, px, poses)
    assert set(found) == {"v0", "v3", "v5", "v6", "v8"}
    assert "9.0 px off" in found["v3"]
    assert "identity" in found["v5"]
    assert found["v8"] == "the pose of v0"
    lenses = made.cameras(9).camtopix
    assert mistakes.of_lenses(names, lenses) == {}
    lenses[2, :2] *= 3
    assert set(mistakes.of_lenses(names, lenses)) == {"v2"}


@pytest.mark.parametrize("times", [2, 4, 8, 0.5, 0.25, 0.125])
def test_numbers_of_a_photo_of_another_size_are_named(times):
    lenses = made.cameras(3).camtopix
    size = made.WIDTH / times, made.HEIGHT / times
    with pytest.raises(ValueError, match=f"photo {times} times as large"):
        mistakes.check_principal_points(lenses, size, "here")
    mistakes.check_principal_points(lenses, (made.WIDTH, made.HEIGHT), "here")
