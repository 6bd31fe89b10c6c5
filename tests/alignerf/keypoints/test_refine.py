"""Cameras by aligned keypoints: finer where photos tell, the same where they do not."""

import json

import numpy as np
import pytest

from alignerf.experiment.checks import scenes as of_scenes
from alignerf.keypoints import adjustment, refine
from tests.alignerf.keypoints import made

NOISE_PX = 0.5
# Median length of the difference of two keypoints, of which one is the reference.
MOVED_PX = np.sqrt(2) * 1.18 * NOISE_PX


@pytest.fixture(scope="module")
def corner():
    """(rotations, centres, points, textures) of a corner."""
    rng = np.random.default_rng(0)
    textures = [made.texture(rng) for _ in range(3)]
    return *made.poses(), made.points_on(rng, 900), textures


@pytest.fixture(scope="module")
def photos(corner):
    turns, centres, _, textures = corner
    return made.photos_of(turns, centres, textures)


def adjusted_model(corner, seed=1, **options):
    """A model whose cameras are adjusted by noisy keypoints, as COLMAP's are."""
    turns, centres, xyz, _ = corner
    rng = np.random.default_rng(seed)
    model = made.model_of(turns, centres, xyz, rng, noise_px=NOISE_PX, **options)
    adjustment.solve(model, "focal")
    model.update_point_3d_errors()
    return model


def errors_of(model, corner):
    turns, centres, xyz, _ = corner
    return made.error_px(model, turns, centres, xyz)


@pytest.fixture(scope="module")
def refined(corner, photos):
    model = adjusted_model(corner)
    return model, *refine.refine(model, photos, free="focal", seed=0)


def test_less_than_half_of_the_error_remains(corner, refined):
    model, finer, told = refined
    before, after = (errors_of(one, corner) for one in (model, finer))
    assert told["accepted"]
    assert np.median(after) < 0.45 * np.median(before)
    assert (after < before + 0.02).all()
    assert told["aligned"] > 0.8
    assert told["moved_px"] == pytest.approx(MOVED_PX, rel=0.2)
    assert told["reprojection_px"][1] < 0.6 * told["reprojection_px"][0]
    assert told["held_out_px"][1] < told["held_out_px"][0]


def test_the_model_given_is_as_it_was(corner, refined):
    model, finer, _ = refined
    again = adjusted_model(corner)
    assert finer is not model
    for number, image in again.images.items():
        own = model.images[number]
        np.testing.assert_array_equal(
            image.cam_from_world().matrix(), own.cam_from_world().matrix()
        )
        np.testing.assert_array_equal(
            [p.xy for p in image.points2D], [p.xy for p in own.points2D]
        )


def test_all_tracks_stay_in_the_model(refined):
    model, finer, _ = refined
    assert finer.num_points3D() > 0.98 * model.num_points3D()


def test_it_is_the_same_on_every_run(corner, photos, refined):
    _, finer, _ = refined
    again, _ = refine.refine(adjusted_model(corner), photos, free="focal", seed=0)
    for number, image in finer.images.items():
        np.testing.assert_array_equal(
            image.cam_from_world().matrix(),
            again.images[number].cam_from_world().matrix(),
        )


def test_photos_may_be_larger_than_colmaps_copies(corner):
    turns, centres, _, textures = corner
    photos = made.photos_of(turns, centres, textures, scale=2)
    model = adjusted_model(corner)
    finer, told = refine.refine(model, photos, free="focal", seed=0, photo_px=2.0)
    assert told["accepted"]
    # Of the photo, which has twice as many.
    assert told["moved_px"] == pytest.approx(2 * MOVED_PX, rel=0.2)
    before, after = (np.median(errors_of(one, corner)) for one in (model, finer))
    assert after < 0.45 * before


def test_photos_of_something_else_change_nothing(corner, photos):
    noise = np.random.default_rng(2).integers(0, 256, (9, 240, 320), np.uint8)
    strange = {n: lambda n=n: noise[n] for n in photos}
    model = adjusted_model(corner)
    same, told = refine.refine(model, strange, free="focal", seed=0)
    assert same is model
    assert not told["accepted"]
    assert "could be aligned" in told["why"]


def test_exposure_changes_do_no_harm(corner, photos, refined):
    def darker(number):
        photo = photos[number]().astype(float)
        return np.round(photo * (0.5 + 0.06 * number) + 5 * number).astype(np.uint8)

    changed = {n: lambda n=n: darker(n) for n in photos}
    finer, told = refine.refine(adjusted_model(corner), changed, free="focal", seed=0)
    assert told["accepted"]
    before, after = (np.median(errors_of(one, corner)) for one in (refined[0], finer))
    assert after < 0.45 * before


def test_too_few_tracks_change_nothing(corner, photos):
    turns, centres, xyz, textures = corner
    few = (turns, centres, xyz[:60], textures)
    model = adjusted_model(few)
    same, told = refine.refine(model, photos, free="focal", seed=0)
    assert same is model
    assert "too few to judge by" in told["why"]


def test_a_principal_point_out_of_the_middle_is_found(corner):
    turns, centres, xyz, textures = corner
    middle = (made.WIDTH / 2 + 5, made.HEIGHT / 2 - 3)
    photos = made.photos_of(turns, centres, textures, middle=middle)
    rng = np.random.default_rng(1)
    model = made.model_of(turns, centres, xyz, rng, noise_px=NOISE_PX, middle=middle)
    model.cameras[1].params = [made.FOCAL_PX, made.WIDTH / 2, made.HEIGHT / 2]
    adjustment.solve(model, "focal")
    finer, told = refine.refine(model, photos, free="focal", more=["centre"], seed=0)
    assert told["refined"] == "centre"
    np.testing.assert_allclose(finer.cameras[1].params[1:], middle, atol=1.0)
    assert model.cameras[1].params[1] == made.WIDTH / 2


def test_a_view_without_keypoints_that_align_moves_with_its_neighbour(corner, photos):
    blind = photos | {3: lambda: np.full((240, 320), 90, np.uint8)}
    model = adjusted_model(corner)
    finer, told = refine.refine(model, blind, free="focal", seed=0)
    assert told["accepted"]
    assert told["kept"] == ["v02"]
    before, after = (errors_of(one, corner) for one in (model, finer))
    assert after[2] < before[2] + 0.25
    assert np.median(after) < 0.45 * np.median(before)


def test_a_lens_that_would_change_much_changes_nothing(corner, photos, monkeypatch):
    def wild(model, free, **options):
        model.cameras[1].params = [2 * made.FOCAL_PX, made.WIDTH / 2, made.HEIGHT / 2]
        return []

    monkeypatch.setattr(adjustment, "adjust", wild)
    model = adjusted_model(corner)
    same, told = refine.refine(model, photos, free="focal", seed=0)
    assert same is model
    assert "lens" in told["why"]


def test_what_fails_changes_nothing(corner, photos, monkeypatch):
    def fails(*args, **options):
        raise np.linalg.LinAlgError("singular matrix")

    monkeypatch.setattr(adjustment, "adjust", fails)
    model = adjusted_model(corner)
    same, told = refine.refine(model, photos, free="focal", seed=0)
    assert same is model
    assert "singular" in told["said"]


def test_without_views_to_judge_by_nothing_changes(corner, photos, monkeypatch):
    monkeypatch.setattr(refine, "MIN_OF_VIEW", 10_000)
    model = adjusted_model(corner)
    same, told = refine.refine(model, photos, free="focal", seed=0)
    assert same is model
    assert "0 views" in told["why"]
    # JSON knows no NaN.
    json.dumps(told, allow_nan=False)


def test_a_view_that_loses_stays_and_does_not_decide_over_all():
    before = refine.Judged({1: 0.2, 2: 0.2, 3: 0.2, 4: 0.2}, {})
    error = dict.fromkeys(before.px, 0.01)
    after = refine.Judged({1: 0.1, 2: 0.1, 3: 0.9, 4: 0.11}, error)
    gain, sure = after.gain_over(before)
    assert gain == pytest.approx(0.095)
    assert sure < 0.02
    assert [refine.loses(before, after, view) for view in (1, 3, 5)] == [
        False,
        True,
        True,
    ]


@pytest.mark.parametrize(
    ("scene", "refines"),
    [
        ({"source": "photos", "path": "p"}, True),
        ({"source": "transforms", "path": "p"}, True),
        ({"source": "photos", "path": "p", "refine_keypoints": False}, False),
        # Its error is to be COLMAP's own.
        ({"source": "courtyard"}, False),
        ({"source": "courtyard", "refine_keypoints": True}, True),
    ],
)
def test_it_is_on_unless_a_key_turns_it_off(scene, refines):
    assert of_scenes.checked(scene)["refine_keypoints"] is refines
