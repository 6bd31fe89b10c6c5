"""Displacements and the seconds of rounds: means that are empty, parts that add up."""

import numpy as np
import pytest

from alignerf.tables import columns, costs
from tests import table_cases
from tests.table_cases import made

PARTS = {key: [0.25, 0.75] for key in columns.PARTS}


def row(**parts):
    """A method's row: two views, whose lengths and shares are all 0.25 and 0.75."""
    return table_cases.row({"standard": {"psnr_db": [20, 20]} | PARTS | parts}, "a_b")


def test_means_are_over_views_and_given_renders_have_none():
    given = table_cases.row({"standard": [20, 20]}, "given", costs={})
    table = made(costs.displacement, [row(), row().assign(round=1), given])
    assert table["round"].tolist() == [0, 1]
    assert table["views"].tolist() == [2, 2]
    assert table[columns.PARTS].eq(0.5).all(axis=None)
    tex = costs.displacement_to_latex(table)
    first, second = table_cases.cells(tex)
    assert first[:3] == [r"a\_b", "0", "0.50"]
    assert second[:3] == ["", "1", "0.50"]
    # Shares are in per cent.
    assert first[-1] == "50"


@pytest.mark.parametrize(
    "name", ["flow_median_px", "camera_fraction", "remainder_p95_px"]
)
def test_one_view_without_a_number_leaves_the_mean_empty(name):
    table = made(
        costs.displacement, [row(), row(**{name: [0.25, np.nan]}).assign(round=1)]
    )
    assert table[name].isna().tolist() == [False, True]
    assert table.drop(columns=name).notna().all(axis=None)
    tex = costs.displacement_to_latex(table)
    assert tex.count("--") == 1
    assert "nan" not in tex


def test_a_part_that_no_row_has_is_left_out():
    lengths = [f"model_{length}_px" for length in ("median", "mean", "p95")]
    without = row(**dict.fromkeys(lengths, np.nan))
    tex = costs.displacement_to_latex(made(costs.displacement, [without]))
    assert "model" not in tex
    assert "--" not in tex
    tex = costs.displacement_to_latex(
        made(costs.displacement, [row(), without.assign(round=1)])
    )
    assert "model" in tex
    assert tex.count("--") == len(lengths)


DB = {"standard": [20.0, 22.0]}
TIMES = [*costs.TIMES, "total_time_s"]


def rounds(rest=3.0, **before):
    """Two rounds: of the first only the training counts."""
    own = {"train_rest_time_s": rest}
    data = {"render_time_s": 2.0, "render_rest_time_s": 2.5}
    data |= {"align_time_s": 0.75, "align_rest_time_s": 1.125}
    line = {f"before_{name}": value for name, value in (data | before).items()}
    first = table_cases.row(DB, "a_b", own=own | data)
    own |= {"before": "a_b/round0"}
    return [first, table_cases.row(DB, "a_b", 1, own=own, **line)]


def test_parts_add_up():
    given = table_cases.row(DB, "given", costs={})
    table = made(costs.round_times, [*rounds(), given])
    assert table["round"].tolist() == [0, 1]
    assert table["total_time_s"].tolist() == [28.0, 34.375]
    assert table[TIMES[:-1]].sum(axis=1).tolist() == [28.0, 34.375]
    assert table[TIMES].iloc[1].tolist()[:-1] == [20, 5, 3, 2, 2.5, 0.75, 1.125]
    assert table[TIMES].iloc[0].isna().tolist() == [False] * 3 + [True] * 4 + [False]
    tex = costs.round_times_to_latex(table)
    assert r"a\_b & 0 & 20.0 & 5.0 & 3.0 & -- & -- & -- & -- & 28.0 \\" in tex


def test_a_view_without_seconds_leaves_the_round_s_empty():
    parts = {"align_time_s": np.nan, "align_rest_time_s": np.nan}
    table = made(costs.round_times, rounds(**parts)[1:])
    empty = [*parts, "total_time_s"]
    assert list(table.columns[table.isna().any()]) == empty
    assert costs.round_times_to_latex(table).count("--") == len(empty)


def test_of_a_folder_of_files(tmp_path):
    """By way of the files: test views are no part of a round."""
    scene = tmp_path / "yard"
    files = [table_cases.written(scene, DB, round=k) for k in (0, 1)]
    table = costs.round_times(table_cases.collect(scene, files))
    assert table["total_time_s"].tolist() == [28.0, 34.375]
