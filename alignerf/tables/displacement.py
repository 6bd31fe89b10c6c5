"""How misaligned, and by what: `python -m alignerf.tables.displacement`.

A row per method and round: means over the views of what `flow.decompose` wrote.
"""

import pandas as pd

from alignerf.command import faults
from alignerf.tables import files as table_files
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


def main(argv=None):
    table_files.run(__doc__, argv, make_table, to_latex)


def make_table(entries):
    """A row per method and round. entry: method, round, stats (CSV)."""
    return pd.DataFrame([row_of(entry) for entry in entries])


def row_of(entry):
    """Means over views; a column that some view lacks stays empty."""
    views = table_files.read_csv(entry["stats"], columns=COLUMNS)
    labels = {"method": entry["method"], "round": entry["round"], "views": len(views)}
    return labels | {name: views[name].mean(skipna=False) for name in COLUMNS}


def to_latex(table):
    """booktabs table: lengths of the parts in px, shares in per cent.

    Without a model's part its columns are left out.
    """
    columns = {
        (f"{title} (px)", name): table[f"{part}_{length}"].map("{:.2f}".format)
        for part, title in PARTS.items()
        if table[f"{part}_median_px"].notna().all()
        for length, name in LENGTHS.items()
    }
    columns |= {
        ("Share (\\%)", name): (100 * table[key]).map("{:.0f}".format)
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


if __name__ == "__main__":
    faults.run(main)
