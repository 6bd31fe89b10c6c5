"""What a run's remedies brought: which score counts, and in which words."""

import json

import pandas as pd
import pytest

from alignerf.verdict import advice, remedies
from tests.alignerf.verdict.test_causes import WELL, gain


def table_of(path, test_sets):
    rows = [
        {
            "method": method,
            "field": f"grid 2^15{', cameras aligned on the way' * (method == 'ours')}",
            "warping": "none",
            "test_set": test_set,
            "difference_to": "plain",
            "total_time_s": 120.0,
            "difference_db": number * (method != "plain"),
            "difference_low_db": number - 0.1,
            "difference_high_db": number + 0.1,
        }
        for method in ("plain", "ours", "rival")
        for number, test_set in enumerate(test_sets, start=1)
    ]
    pd.DataFrame(rows).to_csv(path, index=False)
    return path


@pytest.mark.parametrize(
    ("counts", "most"), [([0, 0], 0), ([0, 7, 3], 7), ([None, 0], 0), ([], None)]
)
def test_the_most_cameras_that_a_training_moved(tmp_path, counts, most):
    """A stop that only warps photos says nothing of cameras."""
    stops = [{} if n is None else {"cameras_moved": n} for n in counts]
    path = tmp_path / "timing.json"
    path.write_text(json.dumps({"alignments": stops}))
    assert remedies.cameras_moved(path) == most
    path.write_text("{}")
    assert remedies.cameras_moved(path) is None


@pytest.mark.parametrize(
    ("test_sets", "db", "usual_db"),
    [
        (("standard", "warped", "aligned_pose"), 3, 1),
        (("standard", "warped", "aligned_pose_gradient"), 3, 1),
        (("standard", "aligned_pose", "oracle"), 3, 3),
        (("standard", "warped"), 1, 1),
    ],
)
def test_gains_of_moved_cameras_are_by_the_fairest_test_set(
    tmp_path, test_sets, db, usual_db
):
    """Others' by the usual one, which all have."""
    found, other = remedies.of_table(table_of(tmp_path / "table.csv", test_sets))
    assert (found.db, other.db) == (db, usual_db)
    assert (other.name, other.on_the_way) == ("rival", False)
    assert found.test_set == test_sets[db - 1]
    assert (found.method, found.on_the_way, found.minutes) == ("ours", True, 2.0)
    assert found.name == "ours, aligned on the way"


def test_gains_from_few_views_are_no_gains():
    gain = ("once", 1.5, 1.2, 1.8, 4.0)
    assert remedies.line(gain, WELL).endswith("in 4 min.")
    few = WELL._replace(test_views=3)
    assert "too few to be sure" in remedies.line(gain, few)
    chance = ("once", 0.02, -0.05, 0.06, 4.0)
    assert "not more than chance" in remedies.line(chance, WELL)


def test_a_gain_says_what_it_is_measured_against():
    for test_set, said in remedies.CALLED_SETS.items():
        line = remedies.line(gain(test_set=test_set), WELL)
        assert said in line


def test_gains_by_cameras_that_stayed_are_not_called_a_loss():
    """Of another program no view can be asked for by another camera."""
    gain = remedies.Gain("mine, once", -0.4, -0.6, -0.2, 3.0, "mine", True, "standard")
    text = remedies.line(gain, WELL)
    assert "cameras that were left as given: true gains are larger" in text
    assert not advice.pays(WELL, gain._replace(low=0.1))
