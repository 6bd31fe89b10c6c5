"""Photos of one textured plane by several cameras, brightened by a known amount."""

import numpy as np
import pytest

from alignerf.cameras import exposure
from alignerf.scenes import cameras

WIDTH, HEIGHT, DISTANCE = 96, 64, 4.0
PIXTOCAM = cameras.intrinsics(80.0, WIDTH, HEIGHT)


def plane(x):
    """Levels of the plane z = -DISTANCE at points [..., 3]."""
    return 110 + 50 * np.sin(2 * x[..., 0]) * np.cos(3 * x[..., 1])


def view(shift, stops, *, size=(WIDTH, HEIGHT), pixtocam=PIXTOCAM):
    """The plane seen straight on from a centre that is moved by `shift` in x."""
    camtoworld = np.eye(4)[:3].copy()
    camtoworld[0, 3] = shift
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    rays = cameras.pixels_to_rays(x, y, pixtocam, camtoworld)
    levels = plane(rays.origins + DISTANCE * rays.directions) * 2.0**stops
    photo = np.clip(np.round(levels), 0, 255).astype(np.uint8)
    photo = np.repeat(photo[..., None], 3, axis=-1)
    depth = np.full(photo.shape[:2], DISTANCE, np.float32)
    return exposure.View(photo, depth, pixtocam, camtoworld)


def found(views):
    return exposure.stops([exposure.sampled(one) for one in views])


def test_a_drift_is_found_back():
    truth = np.linspace(-0.5, 0.5, 9)
    views = [view(0.3 * i, ev) for i, ev in enumerate(truth)]
    np.testing.assert_allclose(found(views), truth, atol=0.02)


def test_large_photos_are_compared_at_a_small_size_in_the_right_place():
    k = 6
    large = {
        "size": (k * WIDTH, k * HEIGHT),
        "pixtocam": PIXTOCAM @ np.diag([1 / k, 1 / k, 1]),
    }
    truth = np.array([0.3, 0.0, -0.3])
    views = [view(0.2 * i, ev, **large) for i, ev in enumerate(truth)]
    small = exposure.sampled(views[0])
    assert max(small.levels.shape) <= exposure.LONGEST_PX
    pixel, _ = cameras.project(small.points, small.pixtocam, small.camtoworld)
    y, x = np.floor(pixel).astype(int)[:, ::-1].T
    np.testing.assert_allclose(pixel - np.floor(pixel), 0.5, atol=1e-6)
    np.testing.assert_allclose(small.levels[y, x], small.seen)
    np.testing.assert_allclose(found(views), truth, atol=0.02)


def test_what_stands_before_a_point_is_not_taken_for_it():
    views = [view(0.3 * i, 0.0) for i in range(5)]
    # A bright thing near the camera covers a part of one photo.
    views[2].photo[:, :40], views[2].depth[:, :40] = 240, 1.0
    np.testing.assert_allclose(found(views), 0, atol=0.02)


def test_pixels_that_are_clipped_or_do_not_count_say_nothing():
    views = [view(0.3 * i, 0.0) for i in range(5)]
    views[1].photo[:30], views[3].photo[30:] = 255, 30
    counts = np.ones((HEIGHT, WIDTH), bool)
    counts[30:] = False
    views[3] = views[3]._replace(counts=counts)
    np.testing.assert_allclose(found(views), 0, atol=0.02)


def test_a_photo_that_shares_nothing_is_unknown():
    views = [view(0.2 * i, 0.1 * i) for i in range(4)] + [view(1e3, 0.0)]
    stops = found(views)
    assert np.isnan(stops[-1])
    assert np.ptp(stops[:-1]) == pytest.approx(0.3, abs=0.02)


def test_of_a_photo_that_is_all_black_nothing_is_known():
    views = [view(0.2 * i, 0.1 * i) for i in range(5)]
    views[2].photo[:] %= int(exposure.DARKEST)
    stops = found(views)
    assert np.isnan(stops).tolist() == [False, False, True, False, False]
    assert np.nanmax(stops) - np.nanmin(stops) == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize("depth", [np.inf, np.nan, 0.0, -1.0])
def test_without_depth_nothing_is_known(depth):
    views = [view(0.2 * i, 0.0) for i in range(3)]
    for one in views:
        one.depth[:] = depth
    assert np.isnan(found(views)).all()


@pytest.mark.parametrize("count", [0, 1])
def test_no_photo_and_one_photo(count):
    assert np.isnan(found([view(0.0, 0.0)] * count)).all()


def test_a_pair_that_is_far_off_does_not_bend_the_others():
    pairs = [(i, j, 0.1 * (j - i), 100) for i in range(6) for j in range(6) if i != j]
    pairs[3] = (*pairs[3][:2], 5.0, 100)
    stops = exposure.solved(6, pairs)
    np.testing.assert_allclose(np.diff(stops), 0.1, atol=0.01)
