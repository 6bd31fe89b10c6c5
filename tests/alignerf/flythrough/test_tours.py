"""The order in which cameras are visited: all of them, on a short way."""

import itertools

import numpy as np
import pytest

from alignerf.flythrough import tours
from tests.alignerf.flythrough import captures


@pytest.mark.parametrize("name", captures.EVERY)
def test_each_camera_is_visited_once_on_no_longer_a_way(name):
    poses = captures.EVERY[name]
    way = tours.order(poses)
    assert sorted(way) == list(range(len(poses)))
    distances = tours.between(poses)
    given = tours.length(distances, np.arange(len(poses)))
    assert tours.length(distances, way) <= given + 1e-9


def test_a_walk_is_found_again_in_shuffled_photos():
    poses = captures.walk(60, seed=3)
    along = poses[tours.order(poses), 0, 3]
    assert (np.diff(along) > 0).all() or (np.diff(along) < 0).all()


def test_photos_taken_in_a_row_stay_in_it():
    poses = captures.ring(30, share=0.8, noise=0)
    assert tours.order(poses).tolist() == list(range(30))


@pytest.mark.parametrize("seed", range(5))
def test_ways_of_few_cameras_are_nearly_the_shortest(seed):
    rng = np.random.default_rng(seed)
    poses = captures.looking(rng.normal(size=(7, 3)) * 3, np.zeros(3))
    distances = tours.between(poses)
    ways = itertools.permutations(range(7))
    best = min(tours.length(distances, np.array(way)) for way in ways)
    found = tours.length(distances, tours.order(poses))
    assert best <= found + 1e-9 <= 1.15 * best


def test_of_very_many_cameras_some_are_visited():
    way = tours.order(captures.ring(1000, share=0.9, noise=0))
    assert len(way) == tours.MOST_CAMERAS
    assert set(way) >= {0, 999}


def test_angles_are_those_between_turns():
    poses = captures.panorama(12)
    found = np.degrees(tours.angles(poses, poses))
    apart = np.abs(np.subtract.outer(range(12), range(12)))
    np.testing.assert_allclose(found, 30 * np.minimum(apart, 12 - apart), atol=1e-4)
