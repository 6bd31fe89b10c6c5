"""Where the time of a round goes: `python -m alignerf.round_times`.

A round renders the training views of the one before, aligns the photos with them, and
trains; round 0 only trains. Each of the three is a process; what it spends besides
its own work (start, import, loading, compiling, writing) is told apart.
"""

import argparse
import json
import pathlib

import pandas as pd

from alignerf import cli

# Column -> heading of the LaTeX table, in seconds.
PARTS = {
    "train_time_s": "training",
    "train_compile_time_s": "its compiling",
    "train_rest_time_s": "its rest",
    "render_time_s": "rendering",
    "render_rest_time_s": "its rest",
    "align_time_s": "flow, warps",
    "align_rest_time_s": "its rest",
}
COLUMNS = ("method", "round", *PARTS, "total_time_s")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", required=True, help="JSON: each round's files")
    parser.add_argument("--csv", required=True, help="table, written")
    parser.add_argument("--tex", required=True, help="table, written")
    args = parser.parse_args(argv)
    table = pd.DataFrame(
        [row_of(entry) for entry in json.loads(args.rows)], columns=COLUMNS
    )
    with cli.replace_file(args.csv) as path:
        table.to_csv(path, index=False, float_format="%.3f")
    with cli.replace_file(args.tex) as path:
        path.write_text(to_latex(table))


def row_of(entry):
    """Seconds of one round.

    entry: method, round, training and rendering (timing files), alignment (CSV of
    displacements), and `walls`, each process's seconds as Snakemake measured them.
    """
    walls = {stage: wall_s(path) for stage, path in entry["walls"].items()}
    training = read_json(entry["training"])
    row = {
        "train_time_s": training["train_time_s"],
        "train_compile_time_s": training["compile_time_s"],
    }
    row["train_rest_time_s"] = walls["train"] - sum(row.values())
    if "render" in walls:
        rendering = read_json(entry["rendering"])
        row["render_time_s"] = rendering["views"] * rendering["view_time_s"]
        row["render_rest_time_s"] = walls["render"] - row["render_time_s"]
        row["align_time_s"] = float(pd.read_csv(entry["alignment"])["time_s"].sum())
        row["align_rest_time_s"] = walls["align"] - row["align_time_s"]
    labels = {key: entry[key] for key in ("method", "round")}
    # A process that went on where another was stopped knows only its own seconds.
    rests = {key: max(row[key], 0.0) for key in row if key.endswith("rest_time_s")}
    return labels | row | rests | {"total_time_s": sum((row | rests).values())}


def read_json(path):
    return json.loads(pathlib.Path(path).read_text())


def wall_s(path):
    """Seconds that a process ran, from Snakemake's benchmark file."""
    found = pd.read_csv(path, sep="\t")
    if "s" not in found or len(found) != 1:
        raise ValueError(f"{path}: not the benchmark of one run")
    return float(found["s"].iloc[0])


def to_latex(table):
    """booktabs table of seconds, a row per method and round."""
    shown = table.rename(columns=PARTS | {"total_time_s": "all"})
    shown["method"] = shown["method"].str.replace("_", r"\_")
    style = shown.style.format(precision=1, na_rep="--").hide(axis="index")
    columns = "lr" + "r" * (len(COLUMNS) - 2)
    tex = style.to_latex(hrules=True, column_format=columns)
    return f"% \\usepackage{{booktabs}}\n% Seconds of each round, by its parts.\n{tex}"


if __name__ == "__main__":
    cli.run(main)
