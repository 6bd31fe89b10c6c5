"""How misaligned, and by what: `tables/displacement.csv`.

A row per method and round: means over the views of what `flow.decompose` wrote.
"""

import pandas as pd

from alignerf.files import csv_files
from alignerf.tables import scores

PARTS = {"flow": "Flow", "model": "Model", "camera": "Camera", "remainder": "Remainder"}
LENGTHS = {"median_px": "median", "mean_px": "mean", "p95_px": "95 \\%"}
SHARES = {"camera_share": "camera", "moved_share": "moved"}
COLUMNS = (
    *(f"{part}_{length}" for part in PARTS for length in LENGTHS),
    *SHARES,
    "moved_mean_px",
    "noise_px",
    "valid_share",
)


def make_table(rows):
    """A line per method and round, of `rows.Displacement`."""
    return pd.DataFrame([line_of(row) for row in rows])


def line_of(row):
    """Means over views; a column that some view lacks stays empty."""
    views = csv_files.read(row.stats, columns=COLUMNS)
    labels = {"method": row.method, "round": row.round, "views": len(views)}
    return labels | {name: views[name].mean(skipna=False) for name in COLUMNS}


def to_latex(table):
    """booktabs table: lengths of the parts in px, shares in per cent.

    A part that no row has is left out: a model's part needs a truth.
    """
    columns = {
        (f"{title} (px)", name): texts(table[f"{part}_{length}"], ".2f")
        for part, title in PARTS.items()
        if table[f"{part}_median_px"].notna().any()
        for length, name in LENGTHS.items()
    }
    columns |= {
        ("Share (\\%)", name): texts(100 * table[key], ".0f")
        for key, name in SHARES.items()
    }
    wide = pd.DataFrame(columns)
    wide.index = pd.MultiIndex.from_arrays(
        [table["method"].map(scores.latex_name), table["round"]],
        names=("Method", "Round"),
    )
    layout = "ll" + "r" * len(columns)
    tex = wide.style.to_latex(hrules=True, multicol_align="c", column_format=layout)
    return (
        "% \\usepackage{booktabs,multirow}\n"
        "% Length of the flow from render to photo, and of its parts: means over the\n"
        f"% test views.\n{tex}"
    )


def texts(column, form):
    """Numbers as text, `--` for one that is not there."""
    return column.map(lambda value: scores.shown(value, form))
