"""Captures of which COLMAP places too few photos: the run stops, and says why."""

import types

import pytest

from alignerf import poses


def model(registered, left_out, models):
    names = [f"view_{number}" for number in range(registered)]
    others = [f"other_{number}" for number in range(left_out)]
    return types.SimpleNamespace(names=names, left_out=others, models=models)


def test_two_scenes_in_one_folder_are_told():
    with pytest.raises(ValueError, match=r"mine: COLMAP registered 20 of 45") as raised:
        poses.check_registered(model(20, 25, [20, 18, 4]), 0.6, "mine")
    assert "models of 18, 4: two scenes?" in str(raised.value)
    assert "colmap.least_registered" in str(raised.value)
    assert "\n" not in str(raised.value)


def test_enough_photos_pass():
    poses.check_registered(model(27, 18, [27]), 0.6, "mine")
    poses.check_registered(model(20, 25, [20]), 0.4, "mine")


def test_photos_that_do_not_overlap_are_no_second_scene():
    with pytest.raises(ValueError, match=r"registered 5 of 20 photos together\. T"):
        poses.check_registered(model(5, 15, [5]), 0.6, "mine")
