"""Take a run of the demo into docs/: `python -m tools.docs.demo results/courtyard`.

Writes its tables into docs/measured, its figures and the picture of its page into
docs/pictures, and its verdict into docs/outputs. Then `make docs`. What pages say of
the run in words is to be read again.
"""

import argparse
import datetime
import json
from pathlib import Path

import pandas as pd
from PIL import Image

from tools.docs import screenshot

MACHINE = (
    "two hyperthreads of one core of a shared x86-64 machine, nothing else of ours "
    "running, no accelerator"
)
# As the tables of docs/ call rows.
NAMES = {"aligned": "aligned (in the loop)", "alignerf": "alignerf (derivative bank)"}
# Quantities of docs/measured/controls.csv.
CONTROLS = (
    *("gain", "pixel_choice", "resampling", "overfit", "remains", "crossfit"),
    *("oracle_offset", "oracle_gain", "pose_gain", "pose_overfit"),
)
SETS = ("standard", "warped", "control", "oracle")
FIGURES, WIDEST_PX = ("rounds", "crops"), 1600


def main(argv=None):
    args = parse(argv)
    tables = args.scene / "tables"
    known = json.loads((tables / "misalignment.provenance.json").read_text())
    header = (
        f"# commit: {known['commit']}\n# lock: {known['lock']}\n"
        f"# machine: {args.machine}\n# command: make run\n"
        f"# measured: {datetime.date.today()}\n"
    )
    made = {
        "misalignment": misalignment(pd.read_csv(tables / "misalignment.csv")),
        "controls": controls(pd.read_csv(tables / "controls.csv")),
        "ranking": ranking(pd.read_csv(tables / "ranking.csv")),
    }
    for name, table in made.items():
        text = table.to_csv(index=False, float_format="%.2f", lineterminator="\n")
        (args.root / "docs" / "measured" / f"{name}.csv").write_text(header + text)
    for name in FIGURES:
        picture = args.root / "docs" / "pictures" / f"courtyard_{name}.png"
        with Image.open(args.scene / "figures" / f"{name}.png") as image:
            image = image.convert("RGB")
        # As wide as a page shows it: a third of the bytes.
        image.thumbnail((WIDEST_PX, WIDEST_PX))
        image.save(picture, optimize=True)
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
    rows["aligned_pose_db"] = scores["aligned_pose"]
    for time in ("train_time_s", "total_time_s"):
        rows[time] = oracle[time].round().astype(int)
    rows["params_million"] = oracle["params"] / 1e6
    rows = in_order(rows, table).reset_index()
    return rows.assign(method=rows["method"].replace(NAMES))


def controls(table):
    """A row for each method without warping and after the last of it."""
    keys = ["method", "warping"]
    rows = table.pivot(index=keys, columns="quantity", values="db")[list(CONTROLS)]
    rows = in_order(rows, table).add_suffix("_db").reset_index()
    return rows[rows["warping"] != "once"]


def in_order(rows, table):
    """Rows by method and warping, as they first stand in a table."""
    order = dict.fromkeys(zip(table["method"], table["warping"], strict=True))
    return rows.reindex(list(order))


def ranking(table):
    """What each test set says of the order of methods."""
    taus = ["tau", "tau_low", "tau_high"]
    return table[["test_set", "rows", *taus]].astype(dict.fromkeys(taus, float))


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="tools.docs.demo", description=__doc__)
    parser.add_argument("scene", type=Path, help="results/courtyard of a run")
    parser.add_argument("--machine", default=MACHINE, help="where it ran")
    parser.add_argument("--root", default=Path("."), type=Path, help="project's folder")
    return parser.parse_args(argv)


if __name__ == "__main__":
    main()
