"""Bundle adjustment: what is planted comes out, and what is right stays."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras as posed
from alignerf.sfm import acceptance, bundle, pose_error
from tests.alignerf.sfm import made


@pytest.mark.parametrize("px", [1.5, 6.0, 30.0])
def test_at_most_a_tenth_of_a_planted_error_remains(rng, tmp_path, px):
    true = made.cameras()
    given = made.perturbed(true, px, rng)
    found = made.matched(true, rng)
    adjusted = bundle.adjust(found, given, tmp_path, seed=0)
    before, after = (
        np.median(made.error_px(true, one, adjusted))
        for one in (given, adjusted.cameras)
    )
    assert before > 0.5 * px
    assert after < 0.1 * before
    assert acceptance.judge(found, given, adjusted.cameras).halved
    # The frame stays the input's, by what the cameras see.
    np.testing.assert_allclose(
        adjusted.cameras.camtoworlds, true.camtoworlds, atol=0.05 * max(px, 3) / 6
    )


def test_lost_poses_are_placed_by_the_points(rng, tmp_path):
    true = made.cameras()
    poses = made.perturbed(true, 1.0, rng).camtoworlds.copy()
    poses[[3, 7]] = np.eye(4)[:3]
    given = true._replace(camtoworlds=poses)
    adjusted = bundle.adjust(made.matched(true, rng), given, tmp_path, seed=0)
    assert adjusted.placed == [3, 7]
    assert made.error_px(true, adjusted.cameras, adjusted).max() < 0.5


def test_a_view_without_tracks_moves_with_its_neighbour(rng, tmp_path):
    true = made.cameras()
    given = made.perturbed(true, 3.0, rng)
    found = made.matched(true, rng, unseen=(5,))
    adjusted = bundle.adjust(found, given, tmp_path, seed=0)
    assert adjusted.carried == [5]
    # As rigidly as the neighbour has moved.
    for neighbour in (4, 6):
        relative = (
            np.linalg.norm(cameras[5, :, 3] - cameras[neighbour, :, 3])
            for cameras in (given.camtoworlds, adjusted.cameras.camtoworlds)
        )
        before, after = relative
        assert after == pytest.approx(before, rel=0.2)


def test_lenses_of_single_frames_become_those_of_their_camera(rng):
    given = made.cameras()
    jitter = np.exp(rng.normal(size=12) * 0.01)
    given.camtopix[:, [0, 1], [0, 1]] *= jitter[:, None]
    given.camtopix[4:6, [0, 1], [0, 1]] *= 3
    groups = bundle.groups_of(given, made.WIDTH)
    assert groups[4] == groups[5]
    assert len(set(np.delete(groups, [4, 5]))) == 1
    assert groups[0] != groups[4]
    shared = bundle.one_lens_each(given, groups).camtopix[:, 0, 0]
    assert len(set(shared)) == 2


def test_moving_things_do_not_carry_the_cameras_away(rng, tmp_path):
    true = made.cameras()
    given = made.perturbed(true, 3.0, rng)
    found = made.matched(true, rng, wrong=0.15)
    adjusted = bundle.adjust(found, given, tmp_path, seed=0)
    assert np.median(made.error_px(true, adjusted.cameras, adjusted)) < 0.3


def test_the_same_twice(rng, tmp_path):
    true = made.cameras()
    given, found = made.perturbed(true, 2.0, rng), made.matched(true, rng)
    one, other = (
        bundle.adjust(found, given, tmp_path / name, seed=0).cameras
        for name in ("one", "other")
    )
    np.testing.assert_allclose(one.camtoworlds, other.camtoworlds, atol=1e-9)


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_a_similarity_by_what_is_seen(rng, scale):
    true = made.cameras()
    turn, shift = Rotation.random(rng=2).as_matrix(), scale * rng.normal(size=3)
    moved = true._replace(
        camtoworlds=posed.apply_similarity(true.camtoworlds, scale, turn, shift)
    )
    points = {view: rng.normal(size=(40, 3)) * 0.8 for view in range(12)}
    found = pose_error.fit(moved, true, points)
    assert found[0] == pytest.approx(scale, rel=1e-6)
    np.testing.assert_allclose(found[1], turn, atol=1e-7)
    np.testing.assert_allclose(found[2], shift, atol=1e-5 * scale)
    assert max(pose_error.distance_px(moved, true, points).values()) < 1e-3


@pytest.mark.parametrize(("scale", "away"), [(3000.0, 0.0), (1.0, 1e6), (1e-3, 0.0)])
def test_units_and_origin_of_the_world_do_not_matter(rng, tmp_path, scale, away):
    true = made.cameras()
    poses = posed.apply_similarity(
        made.perturbed(true, 3.0, rng).camtoworlds, scale, np.eye(3), np.full(3, away)
    )
    given = true._replace(camtoworlds=poses)
    adjusted = bundle.adjust(made.matched(true, rng), given, tmp_path, seed=0)
    assert np.nanmedian(adjusted.points.reprojection_px) < 0.3
    assert np.median(made.error_px(true, adjusted.cameras, adjusted)) < 0.2
    centres = adjusted.cameras.camtoworlds[:, :, 3]
    np.testing.assert_allclose(
        (centres - away) / scale, true.camtoworlds[:, :, 3], atol=0.05
    )


def test_a_camera_keeps_its_model_while_its_focal_lengths_meet(rng, tmp_path):
    """Of two axes that differ by a little, adjusting may make one of both."""
    true = made.cameras()
    given = made.perturbed(true, 1.0, rng)
    given.camtopix[:, 1, 1] *= 1 + 2 * bundle.SQUARE
    found = bundle.adjust(made.matched(true, rng), given, tmp_path, seed=0, free="lens")
    (camera,) = found.model.cameras.values()
    assert camera.model.name == "OPENCV"
    now = found.cameras._replace(camtopix=true.camtopix)
    state = bundle.begun(given, np.zeros(12, int), np.ones(12, bool))
    again = bundle.camera_of(state._replace(cameras=now), 0, (64, 48), 1, lens=True)
    assert again.model.name == "OPENCV"
