"""Mistakes of files of cameras: each is named, and none where there is none."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from alignerf.experiment.keys import scene as scene_keys
from alignerf.scenes import cameras as posed
from alignerf.sfm import mistakes
from tests import job_cases
from tests.alignerf.sfm import made

# A third of what a scene of twelve photos has: enough, in a third of the time.
POINTS = 150
# Of two mistakes at once, some.
SOME = [*mistakes.AXES, *mistakes.MEANINGS, "reversed_order"]
SOME += [f"{way}_{axis}" for way in ("left_handed", "mirrored") for axis in "xyz"]
SOME += ["world_to_camera_opencv", "xyzw_ros", "xyzw_camera_to_world_opencv"]
SOME += ["wxyz_enu_roll_90"]


def reordered(poses, order):
    """Poses whose quaternions' numbers w, x, y, z are read from these places."""
    numbers = Rotation.from_matrix(poses[:, :, :3]).as_quat(scalar_first=True)
    turns = Rotation.from_quat(numbers[:, order], scalar_first=True).as_matrix()
    return np.concatenate([turns, poses[:, :, 3:]], axis=-1)


def planted(name, poses):
    """What a reader takes from a file with a mistake."""
    meaning = max((m for m in mistakes.MEANINGS if name.startswith(m)), default="")
    axes = name.removeprefix(meaning).strip("_")
    if axes in mistakes.AXES:
        turn = mistakes.AXES[axes][1](np.eye(4)[None, :3])[0, :, :3].T
        poses = np.concatenate([poses[:, :, :3] @ turn, poses[:, :, 3:]], axis=-1)
    elif not meaning:
        return mistakes.undone(name, [f"v{k:02d}" for k in range(len(poses))], poses)
    if meaning == "world_to_camera":
        return mistakes.inverted(poses)
    if not meaning:
        return poses
    own = mistakes.turned(poses)
    if meaning == "wxyz":
        return mistakes.turned(reordered(own, (3, 0, 1, 2)))
    if meaning == "xyzw":
        own = mistakes.inverted(own)
    return mistakes.turned(mistakes.inverted(reordered(own, (1, 2, 3, 0))))


def test_the_config_knows_all_of_them():
    assert mistakes.EVERY == scene_keys.CONVENTIONS


@pytest.mark.parametrize(
    "mistake", job_cases.one_of(SOME, *mistakes.MEANINGS, "reversed_order", *SOME[::5])
)
def test_each_mistake_is_named_and_undone(rng, mistake):
    true = made.cameras(arc=2.5)
    found = made.matched(true, rng, points=POINTS)
    poses = planted(mistake, true.camtoworlds)
    told = mistakes.find(found, true.pixtocams, poses)
    assert list(told)[:2] == [mistakes.NONE, mistake]
    undone = mistakes.undone(mistake, found.names, poses)
    np.testing.assert_allclose(undone, true.camtoworlds, atol=1e-9)


@pytest.mark.parametrize("order", ["natural_order", "name_order"])
def test_orders_of_numbers_and_of_names(rng, order):
    true = made.cameras(13)
    names = sorted(f"p{k}" for k in range(13))
    found = made.matched(true, rng, points=POINTS)._replace(names=names)
    place = np.argsort(mistakes.order_of(order, names))
    poses = true.camtoworlds[place]
    told = mistakes.find(found, true.pixtocams, poses)
    assert list(told)[1] == order
    undone = mistakes.undone(order, names, poses)
    np.testing.assert_array_equal(undone, true.camtoworlds)


@pytest.mark.parametrize("px", [0.0, 3.0, 12.0, 40.0])
@pytest.mark.parametrize("wrong", [0.0, 0.3])
def test_poses_that_are_only_inexact_are_none(rng, px, wrong):
    true = made.cameras()
    found = made.matched(true, rng, points=POINTS, wrong=wrong)
    poses = posed.perturb_poses(true.camtoworlds, true.pixtocams, px, rng)
    assert list(mistakes.find(found, true.pixtocams, poses)) == [mistakes.NONE]


def test_without_matches_nothing_is_told(rng):
    true = made.cameras()
    found = made.matched(true, rng, points=POINTS, unseen=range(12))
    poses = mistakes.turned(true.camtoworlds)
    assert list(mistakes.find(found, true.pixtocams, poses)) == [mistakes.NONE]
