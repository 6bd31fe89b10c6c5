"""Where the time of a round goes: `tables/round_times.csv`.

A round renders the training views of the one before, aligns the photos with them, and
trains; round 0 only trains. Each of the three is a process; what it spends besides
its own work (start, import, loading, compiling, writing) is told apart. What it did
for the test views is no part of a round.
"""

import pandas as pd

from alignerf.tables import columns, latex, scores

# Column -> heading of the LaTeX table, in seconds.
PARTS = {
    "train_time_s": "training",
    "train_compile_time_s": "its compiling",
    "train_rest_time_s": "its rest",
    "render_time_s": "rendering",
    "render_rest_time_s": "its rest",
    "align_time_s": "flow, warps",
    "align_rest_time_s": "its rest",
    "total_time_s": "all",
}
# Of the round before, whose views a round begins with.
BEFORE = [name for name in PARTS if name.startswith(("render", "align"))]


def make_table(rows):
    """A line per `results.Row` that was trained."""
    lines = [line_of(row) for row in rows if row.costs]
    return pd.DataFrame(lines, columns=columns.names("round_times"))


def line_of(row):
    """Seconds of one round."""
    line = {
        "train_time_s": row.own["train_time_s"],
        "train_compile_time_s": row.own["compile_time_s"],
        "train_rest_time_s": row.own["train_rest_time_s"],
    }
    if row.before is not None:
        line |= {name: row.before[name] for name in BEFORE}
    labels = {"method": row.method, "round": row.round}
    return labels | line | {"total_time_s": sum(line.values())}


def to_latex(table):
    """Seconds, a row per method and round."""
    rows = [
        [
            latex.name(line["method"]),
            line["round"],
            *(scores.shown(line[name], ".1f") for name in PARTS),
        ]
        for line in table.to_dict("records")
    ]
    heads = ["method", "round", *PARTS.values()]
    notes = ["Seconds of each round, by its parts."]
    return latex.table("lr" + "r" * len(PARTS), [heads], rows, notes)
