"""The table of controls, from hand-made scores."""

import itertools

import numpy as np
import pytest

from alignerf import show
from alignerf.tables import controls, intervals
from tests import table_cases
from tests.table_cases import made

VIEWS = 6
MOVED = ("aligned_pose", "aligned_pose_overfit")
SETS = (*sorted(controls.needed()), "oracle", *MOVED)
# What each is made of: the means of two test sets, the second taken from the first.
WANTED = {
    "gain": ("warped", "standard"),
    "pixel_choice": ("standard_valid", "standard"),
    "resampling": ("control", "standard"),
    "placebo": ("placebo", "standard"),
    "overfit": ("overfit", "overfit_crossfit"),
    "oracle_offset": ("overfit_crossfit", "aligned"),
    # On the pixels of the warped photo, not on all.
    "crossfit": ("crossfit", "standard_valid"),
    "oracle_gain": ("oracle", "standard"),
    "pose_gain": ("aligned_pose", "standard"),
    "pose_overfit": ("aligned_pose_overfit", "oracle"),
}
LINES = [*itertools.product(("plain_one", "other"), ("none", "once"))]


@pytest.fixture
def scores(rng):
    """{test set: dB of the views}."""
    return {name: rng.uniform(15, 25, VIEWS) for name in SETS}


@pytest.fixture
def rows(rng):
    """Two methods of two rounds with random scores."""
    return [
        table_cases.row({name: rng.uniform(15, 25, VIEWS) for name in SETS}, *key)
        for key in itertools.product(("plain_one", "other"), (0, 1))
    ]


def test_a_gain_is_the_sum_of_its_parts(rows):
    table = made(controls.make_table, rows)
    groups = table.groupby(["method", "warping"], sort=False)
    assert [key for key, _ in groups] == LINES
    for row, (_, lines) in zip(rows, groups, strict=True):
        db, psnr_db = (
            lines.set_index("quantity")["db"],
            {name: table_cases.psnr(row, name).mean() for name in SETS},
        )
        for name, (above, below) in WANTED.items():
            assert db[name] == pytest.approx(psnr_db[above] - psnr_db[below])
        parts = db["pixel_choice"] + db["resampling"] + db["overfit"] + db["remains"]
        assert db["gain"] == pytest.approx(parts)
        assert set(lines["views"]) == {VIEWS}


def test_intervals_are_of_differences_view_by_view(rng):
    # A view that is 10 dB harder for both is no doubt about the difference.
    hard = rng.uniform(-10, 10, VIEWS)
    row = table_cases.row({name: 20 + hard + (name == "warped") for name in SETS})
    lines = made(controls.make_table, [row]).set_index("quantity")
    ends = ["db", "low_db", "high_db"]
    assert lines.loc["gain", ends].tolist() == pytest.approx([1, 1, 1])
    low, high = intervals.mean_interval(20 + hard)
    assert lines.loc["standard", ends[1:]].tolist() == pytest.approx([low, high])
    assert high - low > 2


def test_a_view_whose_camera_is_uncertain_is_left_out(scores):
    scores["aligned_pose"][[1, 4]] = np.nan
    lines = made(controls.make_table, [table_cases.row(scores)]).set_index("quantity")
    gain = scores["aligned_pose"] - scores["standard"]
    assert lines.loc["pose_gain", "db"] == pytest.approx(np.nanmean(gain))
    assert lines["views"].to_dict() == dict.fromkeys(lines.index, VIEWS) | {
        "pose_gain": VIEWS - 2
    }


def test_without_an_oracle_its_columns_are_not_there(scores, rows):
    known = {key: db for key, db in scores.items() if key not in ("oracle", *MOVED)}
    table = made(controls.make_table, [table_cases.row(known)])
    later = ("oracle", "oracle_gain", "pose_gain", "pose_overfit")
    assert not {*later} & set(table["quantity"])
    assert "& oracle &" not in controls.to_latex(table)
    assert "oracle gain" in controls.to_latex(made(controls.make_table, rows))


def test_a_view_without_a_score_leaves_its_quantities_empty(scores):
    scores["control"][2] = np.nan
    table = made(controls.make_table, [table_cases.row(scores)])
    for quantity in ("resampling", "remains"):
        line = table_cases.one(table, quantity=quantity)
        assert np.isnan([line["db"], line["low_db"], line["high_db"]]).all()
    assert np.isfinite(table_cases.one(table, quantity="gain")["db"])
    tex = controls.to_latex(table)
    assert tex.count("--") == 2
    assert "nan" not in tex


def test_a_test_set_that_is_needed_is_named(scores):
    del scores["crossfit"]
    reason = "yard: plain after round 0: no test set 'crossfit'"
    with pytest.raises(ValueError, match=reason):
        made(controls.make_table, [table_cases.row(scores)])


def test_the_table_of_latex_marks_what_is_beyond_chance(rows):
    tex = controls.to_latex(made(controls.make_table, rows))
    lines = table_cases.cells(tex)
    assert [line[:2] for line in lines] == [
        *([r"plain\_one", "none"], ["", "once"], ["other", "none"], ["", "once"]),
    ]
    assert {len(line) for line in lines} == {2 + len(controls.shown())}
    assert "Method" in tex
    # A score stands without its interval.
    assert {"[" in line[2] for line in lines} == {False}
    assert {"[" in line[4] for line in lines} == {True}


def test_on_the_screen(rows):
    table = made(controls.make_table, rows)
    shown = show.breakdown(table)
    assert list(shown.index) == LINES
    remains = table[table["quantity"] == "remains"]["db"].round(2)
    assert shown["remains"].tolist() == remains.tolist()
