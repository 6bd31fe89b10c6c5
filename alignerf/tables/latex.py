"""Tables in LaTeX: pandas writes them, from texts of cells."""

import numpy as np
import pandas as pd

from alignerf.tables import columns, scores

# The paper's colours for the best, second and third of a column.
COLOURS = ("FF9999", "FFCC99", "FFFF99")


def of_table(of, lines, shown=(), *, written=None, fixed=(), notes=(), **more):
    """LaTeX of a table's lines as `columns.yaml` has it under `latex`.

    of: the table's name there. Its `rows` tell lines apart, its `cells` come after
    `fixed`; of both those are shown that `lines` has. Its `notes` come before `notes`.
    written: {column of its rows: texts of all lines} that are LaTeX already. shown,
    more: as of `of_lines`.
    """
    spec, written = columns.TABLES[of].latex, written or {}
    rows = {
        heading: written.get(column) or [name(str(one)) for one in lines[column]]
        for column, heading in spec["rows"].items()
    }
    fixed = [*fixed, *((key, *cell) for key, cell in spec.get("cells", {}).items())]
    fixed = [cell for cell in fixed if cell[0] in lines]
    notes = [*spec.get("notes", "").splitlines(), *notes]
    return of_lines(lines, rows, shown, fixed=fixed, notes=notes, **more)


def of_lines(
    lines,
    rows,
    shown,
    *,
    by=None,
    values=(),
    fixed=(),
    notes=(),
    best=None,
):
    """LaTeX of a table's lines: a row for each of `rows`, booktabs.

    rows: {heading: texts of all lines}, what tells rows apart; a text stands once where
    rows below have it too. shown: (column, heading, form) of cells that stand side by
    side for each of `values` of the column `by`; fixed: of those that do not. form: as
    in columns.yaml. notes: lines of comments above. best: columns whose best three are
    coloured, {column: whether higher is better}.
    """
    best, keys = best or {}, list(rows)
    lines = lines.assign(**rows)
    index = lines.drop_duplicates(keys).set_index(keys)
    cells, styles = {}, {}
    for column, heading, form in shown:
        for value in values:
            own = lines[lines[by] == value].set_index(keys).reindex(index.index)
            cells[heading, name(value)] = texts(own, column, form)
            if column in best:
                ours = own[column].astype(float)
                styles[heading, name(value)] = colours(ours, higher=best[column])
    for column, heading, form in fixed:
        cells[heading, ""] = texts(index, column, form)
    table = pd.DataFrame(cells, index=index.index)
    table.columns = pd.MultiIndex.from_tuples(cells)
    # Equal names of a column are no group of columns.
    if not values:
        table.columns = table.columns.droplevel(1)
    style = table.style
    for place, css in styles.items():
        style = style.apply(lambda _, css=css: css, subset=[place])
    head = "".join(f"% {note}\n" for note in notes)
    align = "l" * len(keys) + "r" * len(cells)
    return head + style.to_latex(
        hrules=True, multicol_align="c", multirow_align="naive", column_format=align
    )


def texts(lines, column, form):
    """Texts of a column's cells; an interval's ends stand in columns beside it."""
    if form == "interval":
        ends = zip(*(lines[key] for key in with_ends(column)), strict=True)
        return [difference(*one) for one in ends]
    if form == "range":
        ends = zip(
            *(lines[f"{column}{end}"] for end in ("", "_low", "_high")), strict=True
        )
        return [scores.with_interval(*one) for one in ends]
    numbers = lines[column]
    if form == "min":
        numbers, form = numbers / 60, ".1f"
    elif form == "%":
        numbers, form = 100 * numbers, ".0f"
    elif form == "M":
        numbers, form = numbers.astype(float) / 1e6, ".2f"
    if form == "cells":
        return list(numbers)
    return [scores.shown(one, form) for one in numbers]


def side_by_side(first, second, form, higher, others, within=None):
    """Cells `a / b` of two test sets, as the paper has them; series of one index.

    The best three of the second are coloured, of the first where no row has a second.
    higher: whether higher is better; None: nothing is coloured. others: a mask of rows
    that are never among them. within: a level of the index whose labels have a best
    three each.
    """
    judged = second if second.notna().any() else first
    css = [""] * len(judged)
    if higher is not None:
        ours = judged.astype(float).mask(others)
        css = colours(ours, higher=higher, within=within)
    cells = []
    for one, other, style in zip(first, second, css, strict=True):
        pair = [scores.shown(value, form) for value in (one, other) if pd.notna(value)]
        colour = f"\\{style.replace(':', '', 1)}" if style else ""
        cells.append(colour + (" / ".join(pair) or "--"))
    return cells


def document(text):
    """A table as a document that compiles as it is.

    Package standalone lets `\\input` take its body alone into another document.
    """
    head, _, body = text.partition(r"\begin{tabular}")
    packages = [r"\usepackage{booktabs}", r"\usepackage[table]{xcolor}"]
    begin = [r"\documentclass[border=4pt]{standalone}", *packages, r"\begin{document}"]
    end = [rf"\begin{{tabular}}{body.strip()}", r"\end{document}"]
    return "\n".join([*head.splitlines(), *begin, *end, ""])


def with_ends(column):
    """A column of dB and those of its interval's ends."""
    return scores.with_ends(column.removesuffix("db"))


def metric(key):
    """(column, heading, form) of a metric, with an arrow to where it is better."""
    found = columns.TABLES["comparison"].columns[key]
    arrow = "uparrow" if columns.METRICS.get(key) else "downarrow"
    return key, rf"{found.heading} $\{arrow}$", found.form


def name(text):
    """A name as LaTeX takes it."""
    return text.replace("_", r"\_")


def names(methods, warpings):
    """Names of rows."""
    pairs = zip(methods, warpings, strict=True)
    return [name(scores.row_name(*pair)) for pair in pairs]


def difference(mean, low, high):
    """A difference and, small, its interval; bold where that does not hold 0.

    Nothing of a row's difference to itself.
    """
    if np.isnan(mean):
        return "--"
    if mean == 0 and not (low < 0 or high > 0):
        return ""
    text = f"{mean:+.2f}"
    if scores.significant(low, high):
        text = rf"\textbf{{{text}}}"
    return text if np.isnan(low) else rf"{text} {{\tiny [{low:+.2f}, {high:+.2f}]}}"


def colours(values, *, higher, within=None):
    """Styles of a column's cells: the best three of its values have the colours.

    within: a level of the index; each of its labels has a best three.
    """
    groups = values.groupby(level=within, sort=False) if within else values
    ranks = groups.rank(ascending=not higher, method="min")
    return [
        f"cellcolor:[HTML]{{{COLOURS[int(rank) - 1]}}}" if rank <= 3 else ""
        for rank in ranks
    ]
