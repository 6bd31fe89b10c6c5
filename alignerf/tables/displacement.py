"""How misaligned, and by what: `tables/displacement.csv`.

A row per method and round: means over the test views of the flow from render to photo
and of its parts, as `flow.decompose` measured them.
"""

import pandas as pd

from alignerf.tables import columns, latex, scores

PARTS = {"flow": "Flow", "model": "Model", "camera": "Camera", "remainder": "Remainder"}
LENGTHS = {"median_px": "median", "mean_px": "mean", "p95_px": "95 \\%"}
SHARES = {"camera_share": "camera", "moved_share": "moved"}
NOTES = (
    "Length of the flow from render to photo, and of its parts: means over the",
    "test views.",
)


def make_table(rows):
    """A line per `results.Row` that was trained."""
    lines = [line_of(row) for row in rows if row.costs]
    return pd.DataFrame(lines, columns=columns.names("displacement"))


def line_of(row):
    """Means over views; a column that some view lacks stays empty."""
    views = row.views["standard"][columns.PARTS]
    labels = {"method": row.method, "round": row.round, "views": len(views)}
    return labels | {name: views[name].mean(skipna=False) for name in views}


def to_latex(table):
    """Lengths of the parts in px, shares in per cent.

    A part that no row has is left out: a model's part needs a truth.
    """
    groups = {
        f"{title} (px)": {
            name: [scores.shown(v, ".2f") for v in table[f"{part}_{length}"]]
            for length, name in LENGTHS.items()
        }
        for part, title in PARTS.items()
        if table[f"{part}_median_px"].notna().any()
    }
    groups[r"Share (\%)"] = {
        name: [scores.shown(v, ".0f") for v in 100 * table[key]]
        for key, name in SHARES.items()
    }
    names = map(latex.name, table["method"])
    labels = {"Method": names, "Round": table["round"]}
    return latex.table(*latex.side_by_side(labels, groups), NOTES)
