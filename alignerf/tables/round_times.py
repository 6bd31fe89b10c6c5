"""Where the time of a round goes: `tables/round_times.csv`.

A round renders the training views of the one before, aligns the photos with them, and
trains; round 0 only trains. Each of the three is a process; what it spends besides
its own work (start, import, loading, compiling, writing) is told apart. What it did
for the test views is no part of a round.
"""

import pandas as pd

from alignerf.files import csv_files
from alignerf.tables import files as table_files
from alignerf.tables import scores

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


def make_table(rows):
    """A line per method and round, of `rows.Times`."""
    return pd.DataFrame([line_of(row) for row in rows], columns=COLUMNS)


def line_of(row):
    """Seconds of one round."""
    keys = ("train_time_s", "compile_time_s")
    training = table_files.read_timing(row.training, *keys)
    line = {
        "train_time_s": training["train_time_s"],
        "train_compile_time_s": training["compile_time_s"],
    }
    line["train_rest_time_s"] = wall_s(row.walls.train) - sum(line.values())
    if row.rendering:
        line["render_time_s"] = table_files.data_time_s(row.rendering)
        besides_s = table_files.data_time_s(row.test_rendering)
        rest_s = wall_s(row.walls.render) - besides_s - line["render_time_s"]
        line["render_rest_time_s"] = rest_s
        line["align_time_s"] = table_files.views_time_s(row.alignment)
        besides_s = table_files.data_time_s(row.test_alignment)
        rest_s = wall_s(row.walls.align) - besides_s - line["align_time_s"]
        line["align_rest_time_s"] = rest_s
    # A process that went on where another was stopped knows only its own seconds.
    rests = {key: max(line[key], 0.0) for key in line if key.endswith("rest_time_s")}
    line |= rests
    labels = {"method": row.method, "round": row.round}
    return labels | line | {"total_time_s": sum(line.values())}


def wall_s(path):
    """Seconds that a process ran, from Snakemake's benchmark file."""
    found = csv_files.read(path, sep="\t")
    if "s" not in found or len(found) != 1:
        raise ValueError(f"{path}: not the benchmark of one run")
    return float(found["s"].iloc[0])


def to_latex(table):
    """booktabs table of seconds, a row per method and round."""
    shown = table.rename(columns=PARTS | {"total_time_s": "all"})
    shown["method"] = shown["method"].map(scores.latex_name)
    style = shown.style.format(precision=1, na_rep="--").hide(axis="index")
    columns = "lr" + "r" * (len(COLUMNS) - 2)
    tex = style.to_latex(hrules=True, column_format=columns)
    return f"% \\usepackage{{booktabs}}\n% Seconds of each round, by its parts.\n{tex}"
