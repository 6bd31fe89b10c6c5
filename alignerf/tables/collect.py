"""A scene's scores and trainings, a file each: `python -m alignerf.tables.collect`.

scores.csv has a row per method, round, test set, view and metric: scores of renders,
and of the flow from render to photo its length and its parts. trainings.csv has a row
per training that led to one of them, and per renders that are given: what it was, what
came before it, and what it took. All tables are made of these two.

What a row's files tell, by name:

scores, aligned_pose     scores by view and test set; those by moved cameras
parts                    the flow's parts by view, of `flow.decompose`
timing, process          what the training was and took; Snakemake's measurement of it
render, align            the rendering of the training views, and their flow
render_test, align_test  the same of the test views
render_process, ...      Snakemake's measurement of both
corrections              what putting the cameras right took
displacement             the flow by view, of training views where there is such
"""

import math

import pandas as pd

from alignerf.experiment.tables import rows as table_rows
from alignerf.io import atomic, csv_files, faults, json_files, provenance
from alignerf.tables import columns

# Of a training; seconds are without compilation.
UNKNOWN = ("steps", "rays_seen", "params")
TRAINED = (*UNKNOWN, "train_time_s", "compile_time_s")


OPTIONS = {
    "rows": "JSON: of each row its files",
    "scores": "CSV, written",
    "trainings": "CSV, written",
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    rows = table_rows.read(table_rows.Row, args.rows)
    scores = scores_of([row for row in rows if row.method])
    trainings = pd.DataFrame([line_of(row) for row in rows])
    trainings = trainings.reindex(columns=columns.names("trainings"))
    counts = dict.fromkeys(("round", "steps", "rays_seen", "params"), "Int64")
    with (
        atomic.replace_file(args.scores) as scores_path,
        atomic.replace_file(args.trainings) as trainings_path,
    ):
        scores.to_csv(scores_path, index=False)
        trainings.astype(counts).to_csv(trainings_path, index=False)


def scores_of(rows):
    """The scores of rows, of the same views all."""
    readers = {"scores": views_of, "aligned_pose": views_of, "parts": parts_of}
    tables = [
        reader(row.files[name]).assign(method=row.method, round=row.round)
        for row in rows
        for name, reader in readers.items()
        if name in row.files
    ]
    return pd.concat(tables)[columns.names("scores")]


def views_of(path):
    """Scores by view, test set and metric; an empty one could not be had."""
    table = csv_files.read(path, columns=("view", "test_set", "psnr_db"))
    metrics = [name for name in columns.METRICS if name in table]
    return long(table, metrics, path)


def parts_of(path):
    """Lengths of the flow from render to photo and of its parts, by view."""
    table = csv_files.read(path, columns=("view", *columns.PARTS))
    return long(table.assign(test_set="standard"), columns.PARTS, path)


def long(table, metrics, path):
    """A row per view, test set and metric; ValueError for one that stands twice."""
    if (twice := table.duplicated(["view", "test_set"])).any():
        raise ValueError(f"{path}: {table['view'][twice].iloc[0]!r} stands twice")
    return table.melt(["view", "test_set"], metrics, "metric", "value")


def line_of(row):
    """A line of trainings.csv."""
    line = {name: value for name, value in row._asdict().items() if name != "files"}
    for name in ("way", "flows", "corrected"):
        line[name] = " ".join(line[name])
    files = row.files
    if "timing" in files:
        kinds = dict.fromkeys(TRAINED, json_files.NUMBER)
        # Of another program's training they are not known.
        kinds |= dict.fromkeys(UNKNOWN, json_files.NUMBER_OR_NONE)
        timing = json_files.read(files["timing"], kinds)
        line |= {name: timing[name] for name in TRAINED}
        line |= provenance.of_training(files["timing"])
    if "process" in files:
        process = read_process(files["process"])
        line["memory_mib"] = process["max_rss"]
        work_s = line["train_time_s"] + line["compile_time_s"]
        line["train_rest_time_s"] = rest_s(process["s"], work_s)
    line |= of_renders(files)
    if "corrections" in files:
        seconds = {"time_s": json_files.NUMBER}
        line["correct_time_s"] = json_files.read(files["corrections"], seconds)[
            "time_s"
        ]
    if "displacement" in files:
        views = csv_files.read(files["displacement"], columns=["median_px"])
        line["flow_px"] = views["median_px"].median(skipna=False)
    return line


def of_renders(files):
    """Seconds of rendering and flow; of the rest what their processes took besides."""
    line = {}
    if "render" in files:
        line["render_time_s"] = rendering_s(read_rendering(files["render"]))
        line["align_time_s"] = flow_s(files.get("align"))
    if "render_test" in files:
        of_test = read_rendering(files["render_test"])
        line["view_time_s"] = of_test["view_time_s"]
    if "render_process" in files:
        work_s = line["render_time_s"] + rendering_s(of_test)
        process_s = read_process(files["render_process"])["s"]
        line["render_rest_time_s"] = rest_s(process_s, work_s)
        work_s = line["align_time_s"] + flow_s(files.get("align_test"))
        process_s = read_process(files.get("align_process"))["s"]
        line["align_rest_time_s"] = rest_s(process_s, work_s)
    return line


def rest_s(process_s, work_s):
    """What a process took besides its work.

    One that went on where another was stopped knows only its own seconds.
    """
    return max(process_s - work_s, 0.0) if not math.isnan(work_s) else math.nan


def read_rendering(path):
    """Views that were rendered, and seconds a view."""
    kinds = dict.fromkeys(("views", "view_time_s"), json_files.NUMBER)
    return json_files.read(path, kinds)


def rendering_s(rendering):
    """Seconds of all views: loading and compiling count no more than a training's."""
    return rendering["views"] * rendering["view_time_s"]


def flow_s(path):
    """Seconds of all views of a CSV of displacements; NaN where one view has none."""
    return float(csv_files.read(path, columns=["time_s"])["time_s"].sum(skipna=False))


def read_process(path):
    """Seconds, and memory in MiB (NaN: not known), of Snakemake's benchmark."""
    table = csv_files.read(path, sep="\t", columns=("s", "max_rss"))
    numbers = table[["s", "max_rss"]].apply(pd.to_numeric, errors="coerce")
    return numbers.iloc[0].to_dict()


if __name__ == "__main__":
    faults.run(main)
