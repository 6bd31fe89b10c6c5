"""Mistakes of files of cameras: each is named, and none where there is none."""

import numpy as np
import pytest

from alignerf.experiment.keys import scene as scene_keys
from alignerf.scenes import cameras as posed
from alignerf.sfm import mistakes
from tests.alignerf.sfm import made

PLANT = {name: undo for name, (_, undo) in mistakes.POSES.items()}
PLANT["world_to_camera_opencv"] = lambda p: mistakes.inverted(mistakes.turned(p))
PLANT["reversed_order"] = lambda poses: poses[::-1]


def test_the_config_knows_all_of_them():
    assert mistakes.EVERY == scene_keys.CONVENTIONS


@pytest.mark.parametrize("mistake", PLANT)
def test_each_mistake_is_named_and_undone(rng, mistake):
    true = made.cameras(arc=2.5)
    found = made.matched(true, rng)
    poses = PLANT[mistake](true.camtoworlds)
    told = mistakes.find(found, true.pixtocams, poses)
    assert list(told)[:2] == [mistakes.NONE, mistake]
    undone = mistakes.undone(mistake, found.names, poses)
    np.testing.assert_allclose(undone, true.camtoworlds, atol=1e-9)


@pytest.mark.parametrize("order", ["natural_order", "name_order"])
def test_orders_of_numbers_and_of_names(rng, order):
    true = made.cameras(13)
    names = sorted(f"p{k}" for k in range(13))
    found = made.matched(true, rng)._replace(names=names)
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
    found = made.matched(true, rng, wrong=wrong)
    poses = posed.perturb_poses(true.camtoworlds, true.pixtocams, px, rng)
    assert list(mistakes.find(found, true.pixtocams, poses)) == [mistakes.NONE]


def test_without_matches_nothing_is_told(rng):
    true = made.cameras()
    found = made.matched(true, rng, unseen=range(12))
    poses = mistakes.turned(true.camtoworlds)
    assert list(mistakes.find(found, true.pixtocams, poses)) == [mistakes.NONE]
