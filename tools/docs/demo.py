"""Take a run of the demo into docs/: `python -m tools.docs.demo results/courtyard`.

Writes its tables into docs/measured, pictures of its page into docs/pictures, and its
verdict into docs/outputs. Then `make docs`. What pages say of
the run in words is to be read again.
"""

import argparse
import json
from pathlib import Path

import pandas as pd

from tools.docs import screenshot, take

MACHINE = (
    "two hyperthreads of one core of a shared x86-64 machine, nothing else of ours "
    "running, no accelerator"
)
SETS = ("standard", "warped", "control", "oracle")


def main(argv=None):
    args = parse(argv)
    tables = args.scene / "tables"
    known = json.loads((tables / "misalignment.provenance.json").read_text())
    header = take.header(known, "make run", args.machine)
    table = misalignment(pd.read_csv(tables / "misalignment.csv"))
    text = table.to_csv(index=False, float_format="%.2f", lineterminator="\n")
    (args.root / "docs" / "measured" / "misalignment.csv").write_text(header + text)
    # What its warped test set's gain consists of.
    text = pd.read_csv(tables / "controls.csv").to_csv(index=False, float_format="%.3g")
    (args.root / "docs" / "measured" / "controls.csv").write_text(header + text)
    page = str(args.scene / "index.html")
    screenshot.main([page, "--root", str(args.root)])


def misalignment(table):
    """A row for each method and warping, its scores beside one another."""
    keys = ["method", "warping"]
    scores = table.pivot(index=keys, columns="test_set", values="psnr_db")
    rows = scores[list(SETS)].add_suffix("_db")
    oracle = table[table["test_set"] == "oracle"].set_index(keys)
    ends = [f"difference_{end}db" for end in ("", "low_", "high_")]
    # A row that is compared with itself has no difference.
    compared = oracle[ends]
    rows = rows.join(compared.where(compared.ne(0).any(axis=1), axis=0))
    for time in ("train_time_s", "total_time_s"):
        rows[time] = oracle[time].round().astype(int)
    rows["params_million"] = oracle["params"] / 1e6
    return in_order(rows, table).reset_index()


def in_order(rows, table):
    """Rows by method and warping, as they first stand in a table."""
    order = dict.fromkeys(zip(table["method"], table["warping"], strict=True))
    return rows.reindex(list(order))


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="tools.docs.demo", description=__doc__)
    parser.add_argument("scene", type=Path, help="results/courtyard of a run")
    parser.add_argument("--machine", default=MACHINE, help="where it ran")
    parser.add_argument("--root", default=Path("."), type=Path, help="project's folder")
    return parser.parse_args(argv)


if __name__ == "__main__":
    main()
