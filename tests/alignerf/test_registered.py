"""Captures of which COLMAP places too few photos: the run stops, and says why."""

import types

import numpy as np
import pytest

from alignerf import poses
from alignerf.colmap import loading


def model(registered, left_out, models):
    names = [f"view_{number}" for number in range(registered)]
    others = [f"other_{number}" for number in range(left_out)]
    return types.SimpleNamespace(names=names, left_out=others, models=models)


def test_two_scenes_in_one_folder_are_told():
    with pytest.raises(ValueError, match=r"mine: COLMAP registered 20 of 45") as raised:
        loading.check_registered(model(20, 25, [20, 18, 4]), 0.6, "mine")
    assert "models of 18, 4: two scenes?" in str(raised.value)
    assert "colmap.min_registered" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_enough_photos_pass():
    loading.check_registered(model(27, 18, [27]), 0.6, "mine")
    loading.check_registered(model(20, 25, [20]), 0.4, "mine")


@pytest.mark.parametrize(("train", "least", "stops"), [(2, 3, True), (3, 3, False)])
def test_too_few_to_learn_from_stop_the_run(train, least, stops):
    split = np.array(["test"] + ["train"] * train)
    if not stops:
        poses.check_enough(split, least, "mine")
        return
    with pytest.raises(
        ValueError, match=r"mine: 2 of 3 views .* too few\. Take 20"
    ) as e:
        poses.check_enough(split, least, "mine")
    assert "min_train_views" in str(e.value)


def test_photos_that_do_not_overlap_are_no_second_scene():
    with pytest.raises(ValueError, match=r"registered 5 of 20 photos together\. T"):
        loading.check_registered(model(5, 15, [5]), 0.6, "mine")
