"""The one writer of LaTeX: cells, spans, colours, and numbers that are not there."""

import numpy as np
import pandas as pd
import pytest

from alignerf.tables import latex
from tests import table_cases

LINES = pd.DataFrame(
    [
        ("my_method", "a", 1.0, 90.0),
        ("my_method", "b", 2.0, 90.0),
        ("x", "a", np.nan, 30.0),
    ],
    columns=["method", "set", "psnr_db", "time_s"],
)


def test_a_table_is_whole():
    text = latex.of_lines(
        LINES,
        {"Method": list(map(latex.name, LINES["method"])), "Kind": ["k"] * 3},
        [("psnr_db", "PSNR", ".1f")],
        by="set",
        values=["a", "b"],
        fixed=[("time_s", "min", "min")],
        notes=["First.", "Second."],
    )
    assert text.splitlines() == [
        "% First.",
        "% Second.",
        r"\begin{tabular}{llrrr}",
        r"\toprule",
        r" &  & \multicolumn{2}{c}{PSNR} & min \\",
        r" &  & a & b &  \\",
        r"Method & Kind &  &  &  \\",
        r"\midrule",
        r"my\_method & k & 1.0 & 2.0 & 1.5 \\",
        r"x & k & -- & -- & 0.5 \\",
        r"\bottomrule",
        r"\end{tabular}",
    ]


def test_a_document_holds_one_table():
    text = latex.of_lines(
        LINES.assign(psnr_db=["5 / 6", "7 / 8", "--"]),
        {"Method": list(map(latex.name, LINES["method"])), "Set": LINES["set"]},
        [],
        fixed=[("psnr_db", "PSNR", "cells"), ("time_s", "min", "min")],
        notes=["Of {one} scene."],
    )
    found = latex.document(text)
    assert table_cases.check_document(found) == 4
    # What \\input takes of it into another document is the table alone.
    assert text.partition(r"\begin{tabular}")[2].strip() in found
    assert found.startswith("% Of {one} scene.\n\\documentclass")
    assert found.index(r"\usepackage{booktabs}") < found.index(r"\begin{document}")
    assert r"my\_method & a & 5 / 6 & 1.5 \\" in found


NONE = [np.nan] * 4


@pytest.mark.parametrize(
    ("first", "second", "higher", "cells"),
    [
        # Coloured by the second, and the last row never.
        (
            [9, 2, np.nan, 4],
            [1, 3, 2, 9],
            True,
            ["3 9.0 / 1.0", "1 2.0 / 3.0", "2 2.0"],
        ),
        ([9, 2, 3, 4], NONE, True, ["1 9.0", "3 2.0", "2 3.0"]),
        ([9, 2, np.nan, 4], NONE, False, ["2 9.0", "1 2.0", "--"]),
        ([9, 2, 3, 4], [1, 3, 2, 9], None, ["9.0 / 1.0", "2.0 / 3.0", "3.0 / 2.0"]),
    ],
)
def test_two_test_sets_share_a_cell(first, second, higher, cells):
    others = pd.Series([False, False, False, True])
    pair = [pd.Series(one, dtype=float) for one in (first, second)]
    found = latex.side_by_side(*pair, ".1f", higher, others)
    for place, colour in enumerate(latex.COLOURS, start=1):
        old = rf"\cellcolor[HTML]{{{colour}}}"
        found = [text.replace(old, f"{place} ") for text in found]
    assert found[:3] == cells
    assert found[3] == "4.0 / 9.0" if second is not NONE else "4.0"


@pytest.mark.parametrize("within", [None, "Kind"])
def test_the_best_are_coloured_in_each_block(within):
    kinds = pd.MultiIndex.from_arrays([["one", "other"]], names=["Kind"])
    psnr_db, none = pd.Series([1.0, 2.0], kinds), pd.Series([False, False], kinds)
    text = latex.side_by_side(psnr_db, psnr_db, ".1f", True, none, within)
    best = [
        rf"\cellcolor[HTML]{{{latex.COLOURS[0]}}}{n} / {n}" in text
        for n in ("1.0", "2.0")
    ]
    assert best == [within == "Kind", True]


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((1.0, 0.5, 1.5), r"\textbf{+1.00} {\tiny [+0.50, +1.50]}"),
        ((-1.0, -1.5, -0.5), r"\textbf{-1.00} {\tiny [-1.50, -0.50]}"),
        ((-0.1, -0.5, 0.5), r"-0.10 {\tiny [-0.50, +0.50]}"),
        # Of one view there is no interval.
        ((0.25, np.nan, np.nan), "+0.25"),
        ((np.nan, np.nan, np.nan), "--"),
        # Of a row to itself.
        ((0.0, 0.0, 0.0), ""),
    ],
)
def test_a_difference_is_bold_beyond_chance(ends, text):
    assert latex.difference(*ends) == text


def places(values, *, higher):
    """1, 2 or 3 for the coloured ones, 0 for the others."""
    styles = latex.colours(pd.Series(values, dtype=float), higher=higher)
    marks = [style.partition("{")[2].rstrip("}") for style in styles]
    return [latex.COLOURS.index(mark) + 1 if mark else 0 for mark in marks]


def test_the_best_three_are_coloured_each_in_its_sense():
    assert places([20.0, 23.0, 21.0, 22.0], higher=True) == [0, 1, 3, 2]
    assert places([0.4, 0.1, 0.3, 0.2], higher=False) == [0, 1, 3, 2]
    # A tie is one rank, and what is not there has none.
    assert places([20.0, 20.0, 19.0, np.nan, 18.0], higher=True) == [1, 1, 3, 0, 0]
    assert places([None, None], higher=True) == [0, 0]
