"""The seconds of a round are told apart, and add up."""

import numpy as np
import pandas as pd

from alignerf.tables import round_times
from tests import table_cases

DB = {"standard": [20.0, 22.0]}
PARTS = list(round_times.PARTS)


def rounds(rest=3.0, **before):
    """Two rounds: of the first only the training counts."""
    own = {"train_rest_time_s": rest}
    data = {"render_time_s": 2.0, "render_rest_time_s": 2.5}
    data |= {"align_time_s": 0.75, "align_rest_time_s": 1.125}
    line = pd.Series(own | data | before)
    first = table_cases.row(DB, "a_b", own=own | data)
    return [first, table_cases.row(DB, "a_b", 1, own=own, before=line)]


def test_parts_add_up():
    given = table_cases.row(DB, "given", costs={})
    table = round_times.make_table([*rounds(), given])
    assert table["round"].tolist() == [0, 1]
    assert table["total_time_s"].tolist() == [28.0, 34.375]
    assert table[PARTS[:-1]].sum(axis=1).tolist() == [28.0, 34.375]
    assert table[PARTS].iloc[1].tolist()[:-1] == [20, 5, 3, 2, 2.5, 0.75, 1.125]
    assert table[PARTS].iloc[0].isna().tolist() == [False] * 3 + [True] * 4 + [False]
    tex = round_times.to_latex(table)
    assert r"a\_b & 0 & 20.0 & 5.0 & 3.0 & -- & -- & -- & -- & 28.0 \\" in tex


def test_a_view_without_seconds_leaves_the_round_s_empty():
    parts = {"align_time_s": np.nan, "align_rest_time_s": np.nan}
    table = round_times.make_table(rounds(**parts)[1:])
    empty = [*parts, "total_time_s"]
    assert list(table.columns[table.isna().any()]) == empty
    assert round_times.to_latex(table).count("--") == len(empty)


def test_of_a_folder_of_files(tmp_path):
    """By way of the files: test views are no part of a round."""
    scene = tmp_path / "yard"
    files = [table_cases.written(scene, DB, round=k) for k in (0, 1)]
    table = round_times.make_table(table_cases.collect(scene, files))
    assert table["total_time_s"].tolist() == [28.0, 34.375]
