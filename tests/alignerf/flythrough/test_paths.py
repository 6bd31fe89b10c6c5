"""The path of a film: smooth, closed, among the cameras, looking where they look."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from alignerf.flythrough import paths, tours
from tests.alignerf.flythrough import captures

COUNT = 60


@pytest.fixture(params=captures.EVERY)
def name(request):
    return request.param


@pytest.fixture
def poses(name):
    return captures.normalised(captures.EVERY[name])


@pytest.fixture
def path(poses):
    return paths.through(poses, COUNT)


def is_ellipse(path):
    """There and back is the same way twice; an ellipse is not."""
    return not np.allclose(path[1:], path[:0:-1])


def test_each_is_a_camera(path):
    assert path.shape == (COUNT, 3, 4)
    turns = path[:, :, :3]
    np.testing.assert_allclose(
        turns @ turns.swapaxes(1, 2), [np.eye(3)] * COUNT, atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.det(turns), 1)


def test_it_is_smooth_and_ends_where_it_begins(path):
    """A step is never much longer than those beside it, the last to the first too."""
    closed = np.concatenate([path, path[:2]])
    second = closed[2:] - 2 * closed[1:-1] + closed[:-2]
    assert np.linalg.norm(second[..., 3], axis=-1).max() < 0.05
    assert np.abs(second[..., :3]).max() < 0.05
    assert np.degrees(paths.turns_between(closed)).max() < 10


@pytest.mark.parametrize("name", sorted(captures.EVERY.keys() - {"two", "three"}))
def test_it_stays_among_the_cameras_and_looks_as_they_do(path, poses):
    apart = np.linalg.norm(path[:, None, :, 3] - poses[None, :, :, 3], axis=-1)
    turned = np.degrees(tours.angles(path, poses))
    assert ((apart < 0.5) & (turned < 36)).any(axis=1).all()


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("ring", True),
        ("wall", True),
        *((kind, False) for kind in ("arc", "outwards", "walk", "panorama", "two")),
    ],
)
def test_an_ellipse_is_for_cameras_all_around_or_in_a_plane(kind, expected):
    poses = captures.normalised(captures.EVERY[kind])
    assert is_ellipse(paths.through(poses, COUNT)) == expected


def test_on_an_ellipse_all_look_at_what_the_cameras_look_at():
    poses = captures.normalised(captures.ring(noise=0))
    path = paths.through(poses, COUNT)
    middle = paths.meeting_point(poses)
    sight = middle - path[:, :, 3]
    along = (sight * -path[:, :, 2]).sum(axis=-1)
    np.testing.assert_allclose(along, np.linalg.norm(sight, axis=-1))
    # None is upside down.
    assert (path[:, :, 1] @ poses[:, :, 1].mean(axis=0) > 0).all()


def test_axes_that_meet_behind_the_cameras_meet_nowhere():
    assert (
        paths.meeting_point(captures.normalised(captures.ring(outwards=True))) is None
    )
    assert paths.meeting_point(captures.wall()) is None


def test_before_a_wall_nothing_turns():
    poses = captures.normalised(captures.wall())
    path = paths.through(poses, COUNT)
    assert np.ptp(path[:, :, :3], axis=0).max() < 1e-9
    assert np.abs(path[:, :2, 3]).max() <= np.abs(poses[:, :2, 3]).max()


@pytest.mark.parametrize("seed", range(3))
def test_there_and_back_stays_in_the_hull(seed):
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(30, 3))
    poses = captures.looking(places, places + np.array([9.0, 0.0, 0.0]))
    path = paths.there_and_back(poses, COUNT)
    faces = ConvexHull(places).equations
    outside = path[:, :, 3] @ faces[:, :3].T + faces[:, 3]
    assert outside.max() < 1e-9


@pytest.mark.parametrize("count", [7, 8, 120])
def test_the_way_back_is_the_way_there(count):
    path = paths.there_and_back(captures.walk(), count)
    assert len(path) == count
    for frame in range(1, count):
        np.testing.assert_array_equal(path[frame], path[count - frame])


def test_of_a_long_way_the_middle_is_shown():
    poses = captures.ring(40, share=0.8, noise=0)
    path = paths.there_and_back(poses, COUNT)
    turned = np.degrees(paths.turns_between(path[: COUNT // 2 + 1])).sum()
    assert turned == pytest.approx(paths.MOST_TURN_DEG, abs=2)
    whole = np.degrees(paths.turns_between(poses)).sum()
    assert whole > 2 * turned
    # As far from the one end as from the other.
    ends = tours.angles(path[[0, COUNT // 2]], poses[[0, -1]])
    assert ends[0, 0] == pytest.approx(ends[1, 1], rel=0.1)


def test_one_camera_makes_no_path():
    with pytest.raises(ValueError, match="one camera makes no path"):
        paths.through(captures.ring(1))


def test_cameras_at_one_place_that_look_one_way_stand_still():
    pose = captures.ring(1)
    path = paths.through(np.repeat(pose, 5, axis=0), COUNT)
    np.testing.assert_allclose(path, np.repeat(pose, COUNT, axis=0), atol=1e-9)


def test_means_of_turns_are_turns_between():
    poses = captures.panorama(12)
    weights = np.array([[0.5, 0, 0.5, *[0] * 9], [1, *[0] * 11]])
    found = paths.mean_rotations(poses[:, :, :3], weights)
    np.testing.assert_allclose(found, poses[[1, 0], :, :3], atol=1e-9)
