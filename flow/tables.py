"""A scene's table of misalignment and its parts: `python -m flow.tables`.

A row per method and round: means over the views of what `flow.decompose` wrote.

    python -m flow.tables --rows JSON --csv CSV --tex TEX
"""

import argparse
import json
import sys
from pathlib import Path

import pandas as pd

from flow import cli, files

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


def main(rows, csv, tex):
    """Write the table. rows: JSON list of {method, round, stats: CSV}.

    Both files are written, or neither. Raises ValueError or OSError.
    """
    table = pd.DataFrame([row_of(entry) for entry in json.loads(rows)])
    latex = to_latex(table)
    with files.replacing(csv) as csv_path, files.replacing(tex) as tex_path:
        table.to_csv(csv_path, index=False, float_format="%.6g", lineterminator="\n")
        tex_path.write_text(latex)


def row_of(entry):
    """Means over views; a column that some view lacks stays empty."""
    try:
        views = pd.read_csv(entry["stats"])
    except (pd.errors.ParserError, pd.errors.EmptyDataError) as error:
        raise ValueError(f"{entry['stats']}: {error}") from None
    if missing := sorted(set(COLUMNS) - set(views)):
        raise ValueError(f"{entry['stats']}: no column {missing[0]}")
    if len(views) == 0:
        raise ValueError(f"{entry['stats']}: no view")
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
        [table["method"].str.replace("_", r"\_"), table["round"]],
        names=("Method", "Round"),
    )
    layout = "ll" + "r" * len(columns)
    tex = wide.style.to_latex(hrules=True, multicol_align="c", column_format=layout)
    return (
        "% \\usepackage{booktabs,multirow}\n"
        "% Length of the flow from render to photo, and of its parts: means over the\n"
        f"% test views.\n{tex}"
    )


def run(arguments=None):
    """The command line; returns its exit code."""
    parser = argparse.ArgumentParser(prog="flow.tables", description=__doc__)
    parser.add_argument("--rows", required=True, help="JSON: method, round, stats")
    for name in ("csv", "tex"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    return cli.exit_code(main, **vars(parser.parse_args(arguments)))


if __name__ == "__main__":
    sys.exit(run())
