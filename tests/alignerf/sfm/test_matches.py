"""Matches: what is held out is of no track that is not, and files keep them."""

import numpy as np
import pytest

from alignerf.scenes import prepare
from alignerf.sfm import bundle, calibration, matches
from tests.alignerf.sfm import made


def test_a_track_is_held_out_whole_or_not_at_all(rng):
    found = made.matched(made.cameras(), rng)
    for (i, j), index in zip(found.pairs, found.indices, strict=True):
        np.testing.assert_array_equal(
            found.draws[i][index[:, 0]], found.draws[j][index[:, 1]]
        )
    views, _ = found.places(held_out=True)
    rest, _ = found.places(held_out=False)
    assert len(views) + len(rest) == found.count()
    assert 0.05 < len(views) / found.count() < 0.2


def test_keypoints_without_a_match_are_left_out(rng):
    xy = [rng.random((9, 2)), rng.random((7, 2)), rng.random((5, 2))]
    index = np.array([[8, 0], [3, 6]])
    found = matches.hold_out(
        ["a", "b", "c"], (8, 8), xy, np.array([[0, 1]]), [index], 0
    )
    assert [len(one) for one in found.keypoints] == [2, 2, 0]
    _, ends = found.places()
    np.testing.assert_array_equal(ends[:, 0], xy[0][[8, 3]])
    np.testing.assert_array_equal(ends[:, 1], xy[1][[0, 6]])


def test_none_at_all():
    xy = [np.zeros((0, 2)), np.zeros((3, 2))]
    found = matches.hold_out(["a", "b"], (8, 8), xy, np.zeros((0, 2), int), [], 0)
    assert found.count() == 0
    assert found.places()[0].shape == (0, 2)


def test_a_file_keeps_them(rng, tmp_path):
    found = made.matched(made.cameras(unseen := 6), rng, unseen=(2,))
    matches.write(tmp_path / "matches.npz", found)
    again = matches.load(tmp_path / "matches.npz")
    assert again.names == found.names
    assert len(again.names) == unseen
    for one, other in zip(again.places(), found.places(), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-4)
    for one, other in zip(again.draws, found.draws, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_database_keeps_all_that_is_not_held_out(rng, tmp_path):
    true = made.cameras()
    found = made.matched(true, rng)
    state = bundle.begun(true, np.zeros(12, int), np.ones(12, bool))
    path = bundle.write_database(
        tmp_path / "a.db", found, bundle.model_of(found, state)
    )
    ids = {name: i + 1 for i, name in enumerate(found.names)}
    again = matches.read(path, ids, (made.WIDTH, made.HEIGHT), seed=0)
    kept, _ = found.places(held_out=False)
    assert again.count() == len(kept)
    part = bundle.write_database(
        tmp_path / "b.db", found, bundle.model_of(found, state), 2000
    )
    thinned = matches.read(part, ids, (made.WIDTH, made.HEIGHT), seed=0)
    assert 0.5 * 2000 < thinned.count() < 1.5 * 2000


def test_undistorted_keypoints_are_those_of_a_pinhole(rng):
    bent = made.cameras(distortion=(0.08, -0.05, 0.0, 0.0, 0.0))
    seen = made.matched(bent, np.random.default_rng(1), noise_px=0.0)
    straight = made.matched(made.cameras(), np.random.default_rng(1), noise_px=0.0)
    undone = calibration.undistorted(seen, bent)
    for one, other in zip(undone.keypoints, straight.keypoints, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-4)


@pytest.mark.parametrize("count", [2, 30, 200])
def test_neighbours_grow_with_the_number_of_views(count):
    poses = made.orbit(count, arc=6.0)
    found = matches.neighbours(poses)
    most = count * (matches.NEAREST + 10)
    assert len(found) <= min(count * (count - 1) / 2, most)
    assert all(0 <= i < j < count for i, j in found)
    # Each meets the next, and none meets one that looks the other way alone.
    assert {(i, i + 1) for i in range(count - 1)} <= found


def test_matches_follow_the_views_whose_distortion_was_undone(rng):
    bent = made.cameras(distortion=(0.15, -0.05, 0.0, 0.0, 0.0))
    seen = made.matched(bent, rng, noise_px=0.0)
    photo = prepare.Photo("unread")
    views = prepare.PosedViews(
        names=seen.names,
        pixtocams=bent.pixtocams,
        camtoworlds=bent.camtoworlds,
        width=made.WIDTH,
        height=made.HEIGHT,
        photos=[photo] * 12,
    )
    views = calibration.applied(views, bent, "here")
    assert np.abs(views.pixtocams - bent.pixtocams).max() > 1e-5
    moved = calibration.in_views(seen, bent, views)
    now = calibration.of_views(views, moved)
    errors = calibration.errors_px(*moved.places(), now.pixtocams, now.camtoworlds)
    assert errors.max() < 1e-3
    as_they_were = calibration.errors_px(*seen.places(), now.pixtocams, now.camtoworlds)
    assert np.median(as_they_were) > 0.1


def test_one_place_found_in_two_directions_is_one_track(rng):
    xy = [rng.random((40, 2)) * 99 for _ in range(2)]
    xy = [np.concatenate([one, one[:10]]) for one in xy]
    index = np.stack([np.arange(50)] * 2, axis=1)
    found = matches.hold_out(["a", "b"], (99, 99), xy, np.array([[0, 1]]), [index], 0)
    for draws in found.draws:
        np.testing.assert_array_equal(draws[:10], draws[40:])
