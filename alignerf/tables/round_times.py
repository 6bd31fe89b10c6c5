"""Where the time of a round goes: `python -m alignerf.tables.round_times`.

A round renders the training views of the one before, aligns the photos with them, and
trains; round 0 only trains. Each of the three is a process; what it spends besides
its own work (start, import, loading, compiling, writing) is told apart.
"""

import pandas as pd

from alignerf.command import faults
from alignerf.tables import files as table_files

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
    table_files.run(__doc__, argv, make_table, to_latex, float_format="%.3f")


def make_table(entries):
    """A row per method and round; an entry is that of `row_of`."""
    return pd.DataFrame([row_of(entry) for entry in entries], columns=COLUMNS)


def row_of(entry):
    """Seconds of one round.

    entry: method, round, training and rendering (timing files), alignment (CSV of
    displacements), and `walls`, each process's seconds as Snakemake measured them.
    """
    walls = {stage: wall_s(path) for stage, path in entry["walls"].items()}
    keys = ("train_time_s", "compile_time_s")
    training = table_files.read_timing(entry["training"], *keys)
    row = {
        "train_time_s": training["train_time_s"],
        "train_compile_time_s": training["compile_time_s"],
    }
    row["train_rest_time_s"] = walls["train"] - sum(row.values())
    if "render" in walls:
        keys = ("views", "view_time_s")
        rendering = table_files.read_timing(entry["rendering"], *keys)
        row["render_time_s"] = rendering["views"] * rendering["view_time_s"]
        row["render_rest_time_s"] = walls["render"] - row["render_time_s"]
        row["align_time_s"] = table_files.views_time_s(entry["alignment"])
        row["align_rest_time_s"] = walls["align"] - row["align_time_s"]
    labels = {key: entry[key] for key in ("method", "round")}
    # A process that went on where another was stopped knows only its own seconds.
    rests = {key: max(row[key], 0.0) for key in row if key.endswith("rest_time_s")}
    return labels | row | rests | {"total_time_s": sum((row | rests).values())}


def wall_s(path):
    """Seconds that a process ran, from Snakemake's benchmark file."""
    found = table_files.read_csv(path, sep="\t")
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
    faults.run(main)
