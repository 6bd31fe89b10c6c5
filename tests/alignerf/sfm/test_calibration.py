"""The epipolar error: a slow twin, what it cannot see, and extremes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras as posed
from alignerf.sfm import calibration
from tests.alignerf.sfm import made


def errors_of(found, cameras, held_out=None):
    places = found.places(held_out=held_out)
    return places, calibration.errors_px(
        *places, cameras.pixtocams, cameras.camtoworlds
    )


def by_fundamental_matrix(x, other, i, j, cameras):
    """Mean distance of both keypoints from each other's line, by F of two views."""
    first, second = (
        np.linalg.inv(
            np.vstack(
                [
                    np.concatenate(
                        [pose[:, :3] @ posed.OPENGL_FROM_OPENCV, pose[:, 3:]], axis=1
                    ),
                    [0, 0, 0, 1],
                ]
            )
        )
        for pose in (cameras.camtoworlds[i], cameras.camtoworlds[j])
    )
    relative = second @ np.linalg.inv(first)
    a, b, c = relative[:3, 3]
    cross = np.array([[0, -c, b], [c, 0, -a], [-b, a, 0]])
    fundamental = (
        cameras.pixtocams[j].T @ cross @ relative[:3, :3] @ cameras.pixtocams[i]
    )
    x, other = np.r_[x, 1], np.r_[other, 1]
    line, back = fundamental @ x, fundamental.T @ other
    off = abs(other @ fundamental @ x)
    return (off / np.hypot(*line[:2]) + off / np.hypot(*back[:2])) / 2


def test_it_is_the_distance_from_the_fundamental_matrixs_lines(rng):
    true = made.cameras(5)
    found = made.matched(true, rng, points=20, noise_px=3.0)
    (views, xy), errors = errors_of(found, true)
    for (i, j), (x, other), error in zip(views, xy, errors, strict=True):
        twin = by_fundamental_matrix(x, other, i, j, true)
        assert error == pytest.approx(twin, rel=1e-6, abs=1e-9)


def test_right_cameras_have_none_in_any_frame(rng):
    true = made.cameras()
    found = made.matched(true, rng, noise_px=0.0)
    for scale in (1e-9, 1.0, 1e9):
        turn = Rotation.random(rng=1).as_matrix()
        poses = posed.apply_similarity(
            true.camtoworlds, scale, turn, scale * rng.normal(size=3)
        )
        moved = true._replace(camtoworlds=poses)
        _, errors = errors_of(found, moved)
        assert errors.max() < 1e-5
        places = found.places()
        assert calibration.in_front(*places, moved.pixtocams, poses).all()


def test_a_turn_is_seen_as_the_pixels_that_it_moves(rng):
    true = made.cameras()
    found = made.matched(true, rng, noise_px=0.0)
    poses = true.camtoworlds.copy()
    turn = Rotation.from_rotvec([5.0 / made.FOCAL_PX, 0, 0]).as_matrix()
    poses[4, :, :3] = poses[4, :, :3] @ turn
    (views, _), errors = errors_of(found, true._replace(camtoworlds=poses))
    px = calibration.by_view(views, errors, 12)
    assert px.argmax() == 4
    assert px[4] == pytest.approx(5, rel=0.2)


def test_cameras_at_one_place_are_compared_by_their_turns(rng):
    true = made.cameras(2)
    poses = true.camtoworlds.copy()
    poses[:, :, 3] = poses[0, :, 3]
    xy = np.array([[[320.0, 240.0], [320.0, 240.0]]])
    views = np.array([[0, 1]])
    same = np.stack([poses[0], poses[0]])
    assert calibration.errors_px(views, xy, true.pixtocams, same) == pytest.approx(0)
    turned = calibration.errors_px(views, xy, true.pixtocams, poses)
    angle = 2.0 / 2
    assert turned == pytest.approx(made.FOCAL_PX * np.tan(angle), rel=0.1)


def test_points_behind_do_not_meet(rng):
    true = made.cameras()
    found = made.matched(true, rng, noise_px=0.0)
    away = true.camtoworlds.copy()
    # Positions through the middle: each pair's lines stay, and rays run apart.
    away[:, :, 3] = -away[:, :, 3]
    views, xy = found.places()
    assert not calibration.in_front(views, xy, true.pixtocams, away).any()


def test_a_view_without_matches_has_no_error():
    views = np.array([[0, 1], [0, 1]])
    px = calibration.by_view(views, np.array([1.0, 3.0]), 3)
    np.testing.assert_allclose(px[:2], 2.0)
    assert np.isnan(px[2])
    none = calibration.by_view(np.zeros((0, 2), int), np.zeros(0), 2)
    assert np.isnan(none).all()
