"""A second adjustment: finer cameras where tracks tell, the same where they do not."""

import json

import numpy as np
import pycolmap
import pytest

from alignerf.experiment.checks import scenes as of_scenes
from alignerf.keypoints import adjustment, readjustment
from tests.alignerf.keypoints import made

NOISE_PX = 0.3


@pytest.fixture(scope="module")
def corner():
    """(rotations, centres, points, drift) of a corner; on the floor something moves."""
    rng = np.random.default_rng(0)
    xyz = made.points_on(rng, 1500)
    moves = (np.abs(xyz - [1.0, 1.0, 0.0]) < [0.5, 0.5, 1e-6]).all(axis=1)
    # It has much detail, and so many keypoints.
    more = rng.uniform([0.5, 0.5, 0.0], [1.5, 1.5, 0.0], size=(900, 3))
    xyz, moves = np.concatenate([xyz, more]), np.r_[moves, np.ones(len(more), bool)]
    return *made.poses(), xyz, moves[:, None] * np.array([0.012, -0.008, 0.0])


def adjusted_model(corner, seed=1, **options):
    """A model as COLMAP leaves it: by all keypoints, with a wide loss."""
    turns, centres, xyz, drift = corner
    rng = np.random.default_rng(seed)
    options = {"noise_px": NOISE_PX, "drift": drift} | options
    model = made.model_of(turns, centres, xyz, rng, **options)
    adjustment.run(model, adjustment.options_of("focal", 1.0, "TRIVIAL"))
    model.update_point_3d_errors()
    return model


def errors_of(model, corner):
    turns, centres, xyz, drift = corner
    return made.error_px(model, turns, centres, xyz[~drift.any(axis=1)])


@pytest.fixture(scope="module")
def refined(corner):
    model = adjusted_model(corner)
    return model, *readjustment.refine(model, free="focal", seed=0)


def test_less_than_half_of_the_error_remains(corner, refined):
    model, finer, told = refined
    before, after = (errors_of(one, corner) for one in (model, finer))
    assert told["accepted"]
    assert np.median(after) < 0.5 * np.median(before)
    assert (after < before + 0.02).all()
    assert told["gain"][0] > 2 * told["gain"][1]


def test_the_model_given_is_as_it_was(corner, refined):
    model, finer, _ = refined
    again = adjusted_model(corner)
    assert finer is not model
    for number, image in again.images.items():
        own = model.images[number]
        np.testing.assert_array_equal(
            image.cam_from_world().matrix(), own.cam_from_world().matrix()
        )


def test_it_is_the_same_on_every_run(corner, refined):
    _, finer, _ = refined
    again, _ = readjustment.refine(adjusted_model(corner), free="focal", seed=0)
    for number, image in finer.images.items():
        np.testing.assert_array_equal(
            image.cam_from_world().matrix(),
            again.images[number].cam_from_world().matrix(),
        )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_right_cameras_stay(corner, seed):
    """Nothing moves: fewer keypoints cost a little, and no lens is freed by chance."""
    turns, centres, xyz, _ = corner
    still = (turns, centres, xyz, np.zeros_like(xyz))
    model = adjusted_model(still, seed)
    before = errors_of(model, still)
    now, told = readjustment.refine(model, free="focal", more=["centre"], seed=seed)
    assert told["refined"] == "focal"
    assert np.median(errors_of(now, still)) < np.median(before) + 0.03


@pytest.mark.parametrize(
    ("gain", "accepted"), [((0.0, np.inf), False), ((0.0, 0.0), True)]
)
def test_tracks_that_tell_nothing_are_no_fault(corner, monkeypatch, gain, accepted):
    """Fewer than two in common, or each as it was: no NaN, and no division by 0."""
    monkeypatch.setattr(readjustment, "gain_over", lambda before, after: gain)
    _, told = readjustment.refine(adjusted_model(corner), free="focal", seed=0)
    assert told["accepted"] is accepted
    json.dumps(told, allow_nan=False)


def test_too_few_tracks_change_nothing(corner):
    turns, centres, xyz, drift = corner
    model = adjusted_model((turns, centres, xyz[:60], drift[:60]))
    same, told = readjustment.refine(model, free="focal", seed=0)
    assert same is model
    assert "too few to judge by" in told["why"]


def test_a_principal_point_out_of_the_middle_is_found(corner):
    middle = (made.WIDTH / 2 + 5, made.HEIGHT / 2 - 3)
    model = adjusted_model(corner, middle=middle)
    model.cameras[1].params = [made.FOCAL_PX, made.WIDTH / 2, made.HEIGHT / 2]
    adjustment.solve(model, "focal")
    finer, told = readjustment.refine(model, free="focal", more=["centre"], seed=0)
    assert told["refined"] == "centre"
    np.testing.assert_allclose(finer.cameras[1].params[1:], middle, atol=1.5)
    assert model.cameras[1].params[1] == made.WIDTH / 2


def refused(corner, monkeypatch, adjust):
    """What is told of an adjustment after which the model stays as it is."""
    monkeypatch.setattr(adjustment, "adjust", adjust)
    model = adjusted_model(corner)
    same, told = readjustment.refine(model, free="focal", seed=0)
    assert same is model
    return told


def test_a_lens_that_would_change_much_changes_nothing(corner, monkeypatch):
    def wild(model, free, **options):
        model.cameras[1].params = [2 * made.FOCAL_PX, made.WIDTH / 2, made.HEIGHT / 2]
        return []

    told = refused(corner, monkeypatch, wild)
    assert "lens" in told["why"]


def test_what_fails_changes_nothing(corner, monkeypatch):
    def fails(*args, **options):
        raise np.linalg.LinAlgError("singular matrix")

    told = refused(corner, monkeypatch, fails)
    assert "singular" in told["said"]


def test_cameras_that_lose_stay(corner, monkeypatch):
    def worse(model, free, **options):
        for image in model.images.values():
            turn = pycolmap.Rotation3d(0.01 * image.image_id * np.array([0, 1.0, 0]))
            pose = pycolmap.Rigid3d(turn, np.zeros(3)) * image.cam_from_world()
            image.frame.set_cam_from_world(image.camera_id, pose)
        return []

    told = refused(corner, monkeypatch, worse)
    assert "standard errors" in told["why"]
    # JSON knows no NaN.
    json.dumps(told, allow_nan=False)


@pytest.mark.parametrize(
    ("scene", "again"),
    [
        ({"source": "photos", "path": "p"}, True),
        ({"source": "transforms", "path": "p"}, True),
        ({"source": "photos", "path": "p", "adjust_again": False}, False),
        # Its error is to be COLMAP's own.
        ({"source": "courtyard"}, False),
        ({"source": "courtyard", "adjust_again": True}, True),
    ],
)
def test_it_is_on_unless_a_key_turns_it_off(scene, again):
    assert of_scenes.checked(scene).adjust_again is again
