"""Tables in LaTeX: one writer for all."""

import itertools
from typing import NamedTuple

import numpy as np
import pandas as pd

from alignerf.tables import scores

# The paper's colours for the best, second and third of a column.
COLOURS = ("FF9999", "FFCC99", "FFFF99")
# Between two rows: a line.
RULE = r"\midrule"


class Span(NamedTuple):
    """A cell over several columns."""

    text: str
    columns: int
    align: str = "c"


def table(align, heads, rows, notes=(), *, colours=False):
    """A booktabs table.

    align: a letter a column, as `tabular` takes them. heads: rows of headings. rows:
    lists of cells (text, or a Span), or RULE. notes: lines of comments above it.
    colours: whether a cell has one; xcolor is needed then.
    """
    needed = r"\usepackage{booktabs}" + r" \usepackage[table]{xcolor}" * colours
    return "\n".join(
        [
            *(f"% {note}" for note in (needed, *notes)),
            rf"\begin{{tabular}}{{{align}}}",
            r"\toprule",
            *map(line, heads),
            RULE,
            *(row if row == RULE else line(row) for row in rows),
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )


def line(cells):
    """A row of cells."""
    return " & ".join(map(cell, cells)) + r" \\"


def cell(content):
    """One cell's text; a Span over several columns."""
    if not isinstance(content, Span):
        return str(content)
    return rf"\multicolumn{{{content.columns}}}{{{content.align}}}{{{content.text}}}"


def blocks(rows):
    """Rows of several blocks, a line between each two."""
    parted = [[*block, RULE] for block in rows]
    return list(itertools.chain(*parted))[:-1]


def rows_of(columns):
    """Rows of cells from columns of cells."""
    return list(map(list, zip(*columns, strict=True)))


def side_by_side(labels, groups):
    """(align, heads, rows) of groups of columns beside labels, which stand once each.

    labels: {heading: cells}, at the left. groups: {heading: {heading below it: cells}},
    at the right.
    """
    first, *others = labels.values()
    body = [once(list(first)), *others]
    heads = [[*labels], [""] * len(labels)]
    for heading, group in groups.items():
        heads[0].append(Span(heading, len(group)))
        heads[1] += map(name, group)
        body += group.values()
    align = "l" * len(labels) + "r" * (len(body) - len(labels))
    return align, heads, rows_of(body)


def once(labels):
    """Labels of rows, each empty where it is the one above."""
    above = [None, *labels[:-1]]
    return ["" if a == b else b for a, b in zip(above, labels, strict=True)]


def name(text):
    """A name as LaTeX takes it."""
    return text.replace("_", r"\_")


def difference(mean, low, high):
    """A difference and, small, its interval; bold where that does not hold 0."""
    if np.isnan(mean):
        return "--"
    text = f"{mean:+.2f}"
    if scores.significant(low, high):
        text = rf"\textbf{{{text}}}"
    return text if np.isnan(low) else rf"{text} {{\tiny [{low:+.2f}, {high:+.2f}]}}"


def coloured(texts, values, *, higher):
    """Texts of a column's cells; the best three of its values have the colours."""
    ranks = pd.Series(list(values), dtype=float)
    ranks = ranks.rank(ascending=not higher, method="min")
    return [
        rf"\cellcolor[HTML]{{{COLOURS[int(rank) - 1]}}}{text}" if rank <= 3 else text
        for text, rank in zip(texts, ranks, strict=True)
    ]
