"""Displacements: means that are empty."""

import numpy as np

from alignerf.tables import columns, displacement
from tests import table_cases
from tests.table_cases import made

PARTS = {key: [0.25, 0.75] for key in columns.PARTS}


def row(**parts):
    """A method's row: two views, whose lengths and shares are all 0.25 and 0.75."""
    return table_cases.row({"standard": {"psnr_db": [20, 20]} | PARTS | parts}, "a_b")


def test_means_are_over_views():
    table = made(displacement.make_table, [row(), row().assign(round=1)])
    assert table["round"].tolist() == [0, 1]
    assert table["views"].tolist() == [2, 2]
    assert table[columns.PARTS].eq(0.5).all(axis=None)
    tex = displacement.to_latex(table)
    first, second = table_cases.cells(tex)
    assert first[:3] == [r"a\_b", "0", "0.50"]
    assert second[:3] == ["", "1", "0.50"]
    # Shares are in per cent.
    assert first[-1] == "50"


def test_a_part_that_no_row_has_is_left_out():
    lengths = [f"model_{length}_px" for length in ("median", "mean", "p95")]
    without = row(**dict.fromkeys(lengths, np.nan))
    tex = displacement.to_latex(made(displacement.make_table, [without]))
    assert "model" not in tex
    assert "--" not in tex
    tex = displacement.to_latex(
        made(displacement.make_table, [row(), without.assign(round=1)])
    )
    assert "model" in tex
    assert tex.count("--") == len(lengths)
