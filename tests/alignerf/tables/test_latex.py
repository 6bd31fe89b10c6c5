"""The one writer of LaTeX: cells, spans, colours, and numbers that are not there."""

import numpy as np
import pytest

from alignerf.tables import latex


def test_a_table_is_whole():
    heads = [["Method", latex.Span("PSNR", 2)], ["", "a", "b"]]
    rows = [[latex.name("my_method"), 1, "2"], latex.RULE, ["x", "", "--"]]
    assert latex.table("lrr", heads, rows, ["First.", "Second."]).splitlines() == [
        r"% \usepackage{booktabs}",
        "% First.",
        "% Second.",
        r"\begin{tabular}{lrr}",
        r"\toprule",
        r"Method & \multicolumn{2}{c}{PSNR} \\",
        r" & a & b \\",
        r"\midrule",
        r"my\_method & 1 & 2 \\",
        r"\midrule",
        r"x &  & -- \\",
        r"\bottomrule",
        r"\end{tabular}",
    ]
    text = latex.table("l", [["a"]], [["b"]], colours=True)
    assert text.splitlines()[0].endswith(r"\usepackage[table]{xcolor}")


def test_blocks_have_a_line_between_each_two():
    one, two = [["a"], ["b"]], [["c"]]
    assert latex.blocks([one, two]) == [["a"], ["b"], latex.RULE, ["c"]]
    assert latex.blocks([one]) == one


def test_a_label_stands_once():
    assert latex.once(["a", "a", "b", "a"]) == ["a", "", "b", "a"]


@pytest.mark.parametrize(
    ("ends", "text"),
    [
        ((1.0, 0.5, 1.5), r"\textbf{+1.00} {\tiny [+0.50, +1.50]}"),
        ((-1.0, -1.5, -0.5), r"\textbf{-1.00} {\tiny [-1.50, -0.50]}"),
        ((-0.1, -0.5, 0.5), r"-0.10 {\tiny [-0.50, +0.50]}"),
        # Of one view there is no interval.
        ((0.25, np.nan, np.nan), "+0.25"),
        ((np.nan, np.nan, np.nan), "--"),
    ],
)
def test_a_difference_is_bold_beyond_chance(ends, text):
    assert latex.difference(*ends) == text


def places(values, *, higher):
    """1, 2 or 3 for the coloured ones, 0 for the others."""
    texts = latex.coloured(list("abcde"[: len(values)]), values, higher=higher)
    marks = [text.partition("{")[2].partition("}")[0] for text in texts]
    return [latex.COLOURS.index(mark) + 1 if mark else 0 for mark in marks]


def test_the_best_three_are_coloured_each_in_its_sense():
    assert places([20.0, 23.0, 21.0, 22.0], higher=True) == [0, 1, 3, 2]
    assert places([0.4, 0.1, 0.3, 0.2], higher=False) == [0, 1, 3, 2]
    # A tie is one rank, and what is not there has none.
    assert places([20.0, 20.0, 19.0, np.nan, 18.0], higher=True) == [1, 1, 3, 0, 0]
    assert places([None, None], higher=True) == [0, 0]
    text = r"\cellcolor[HTML]{FF9999}a"
    assert latex.coloured(["a"], [1.0], higher=True) == [text]
