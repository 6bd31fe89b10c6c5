"""Print the finished tables and verdicts: `python -m alignerf.show [results]`."""

import argparse
import pathlib
import shutil
import sys

import pandas as pd

from alignerf import testsets
from alignerf.experiment import targets
from alignerf.io import csv_files, faults, yaml_files
from alignerf.tables import scores

# Columns of controls.csv that are shown.
BREAKDOWN = (
    *("gain", "pixel_choice", "resampling", "overfit", "remains"),
    *("crossfit", "oracle_offset", "oracle_gain"),
    *("pose_gain", "pose_overfit"),
)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", nargs="?", default="results", type=pathlib.Path)
    args = parser.parse_args(argv)
    tables = sorted(args.results.glob("*/tables/misalignment.csv"))
    if not tables:
        raise ValueError(f"{args.results}: no misalignment table in it yet")
    for path in tables:
        print(f"\n{path.parent.parent.name}")
        table = csv_files.read(path)
        print(fitting(pivot(table)))
        print("difference to the same model without warping; *: beyond chance (95 %)")
        for line in below_baseline(table, staged_of(path.parent.parent)):
            print(line)
        controls = path.with_name("controls.csv")
        if controls.is_file():
            print("\nwhat the higher score on the warped test set is made of, in dB")
            print(fitting(breakdown(csv_files.read(controls))))
        print(f"tables   {path}, {path.with_suffix('.tex').name}")
        print(f"figures  {path.parent.parent / 'figures'}/")
    scenes = [path.parent.parent.name for path in tables]
    print("\n".join(targets.verdicts(scenes, results=args.results)))


def fitting(table):
    """A table as text, in blocks of columns where the terminal is narrower."""
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    return table.to_string(na_rep="--", line_width=width)


def pivot(table):
    """PSNR in dB per method and warping, test sets side by side, and the cost.

    Behind each score stands its difference to the same model without warping.
    """
    keys = ["method", "warping"]
    texts = [score_text(row) for row in table.itertuples()]
    shown = table.assign(text=texts)
    psnr = shown.pivot(index=keys, columns="test_set", values="text")
    costs = table.drop_duplicates(keys).set_index(keys)
    psnr = psnr.reindex(costs.index)[list(dict.fromkeys(table["test_set"]))]
    psnr.columns = [f"{name} dB" for name in psnr.columns]
    cost = costs[["train_time_s", "total_time_s", "params"]]
    # Finished renders have none.
    cost = cost.map(lambda value: scores.shown(value, ".0f"))
    return psnr.join(cost)


def staged_of(folder):
    """The methods of a scene's folder that fine-tune on patches."""
    path = folder / "config.yaml"
    methods = yaml_files.read(path)["methods"] if path.is_file() else {}
    return [name for name, method in methods.items() if method["alignerf"]]


def below_baseline(table, staged):
    """A line for each staged method that is significantly below its baseline.

    Scores are those against the oracle; without a truth, those on the standard set.
    """
    test_set = testsets.fairest(set(table["test_set"]))
    others = table[table["method"].isin(staged) & (table["test_set"] == test_set)]
    for row in others.itertuples():
        if row.difference_high_db < 0:
            yield (
                f"{row.method} is {-row.difference_db:.2f} dB worse than "
                f"{row.difference_to} ({test_set}). That is expected after "
                f"{row.steps:.0f} steps.\n"
                "  It trains on patches, which teach less a step than rays from "
                "everywhere. `aligned_loss: {}` has its loss without them: "
                "docs/evidence/reproduction.md"
            )


def breakdown(controls):
    """The controls per method and warping: what the gain is made of."""
    wide = controls.pivot(index=["method", "warping"], columns="quantity", values="db")
    order = controls.drop_duplicates(["method", "warping"])
    quantities = [name for name in BREAKDOWN if name in wide]
    wide = wide.reindex(pd.MultiIndex.from_frame(order[["method", "warping"]]))
    return wide[quantities].round(2)


def score_text(row):
    """`22.52 +0.65*`: score and difference; a star where its interval holds no 0."""
    if pd.isna(row.psnr_db):
        return "--"
    if pd.isna(row.difference_db) or is_base(row):
        return f"{row.psnr_db:.2f}" + " " * len(" +0.00*")
    sure = scores.significant(row.difference_low_db, row.difference_high_db)
    return f"{row.psnr_db:.2f} {row.difference_db:+.2f}{'*' if sure else ' '}"


def is_base(row):
    return row.method == row.difference_to and row.warping == scores.warping(0)


if __name__ == "__main__":
    faults.run(main)
