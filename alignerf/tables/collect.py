"""A scene's scores and trainings, a file each: `python -m alignerf.tables.collect`.

scores.csv has a row per method, round, test set, view and metric: scores of renders,
and of the flow from render to photo its length and its parts. Without test set and
view it has the costs of a method and round: of all trainings that lead to it.
trainings.csv has a row per training: its names, what it took, what made it. All tables
are made of these two.

What a row's files tell, by name:

scores, aligned_pose     scores by view and test set; those by moved cameras
parts                    the flow's parts by view, of `flow.decompose`
timing, process          what the training was and took; Snakemake's measurement of it
render, align            the rendering of the training views, and their flow
corrections              what putting the cameras right took
"""

import pandas as pd

from alignerf.experiment.tables import rows as table_rows
from alignerf.io import atomic, csv_files, faults, json_files, provenance
from alignerf.tables import columns

# Of a training; seconds are without compilation.
TRAINED = ("steps", "rays_seen", "params", "train_time_s", "compile_time_s")
# Summed over all trainings that lead to a row.
SUMMED = ["train_time_s", "steps", "rays_seen"]


OPTIONS = {
    "rows": "JSON: of each row its files",
    "scores": "CSV, written",
    "trainings": "CSV, written",
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    rows = table_rows.read(table_rows.Row, args.rows)
    named = [row for row in rows if row.method]
    trainings = pd.DataFrame([line_of(row) for row in rows])
    trainings = trainings.reindex(columns=columns.names("trainings"))
    # Two methods may share a training: each has a line of its own.
    by_folder = trainings.drop_duplicates("folder").set_index("folder")
    scores = pd.concat(
        [*map(scores_of, named), *(costs_of(r, by_folder) for r in named)]
    )
    counts = dict.fromkeys(("round", "steps", "rays_seen", "params"), "Int64")
    with (
        atomic.replace_file(args.scores) as scores_path,
        atomic.replace_file(args.trainings) as trainings_path,
    ):
        scores[columns.names("scores")].to_csv(scores_path, index=False)
        trainings.astype(counts).to_csv(trainings_path, index=False)


def scores_of(row):
    """The scores of a row, by test set and view."""
    readers = {"scores": views_of, "aligned_pose": views_of, "parts": parts_of}
    known = [reader(row.files[n]) for n, reader in readers.items() if n in row.files]
    return pd.concat(known).assign(method=row.method, round=row.round)


def costs_of(row, trainings):
    """The costs of a row: sums over the trainings on its way, the model of the last."""
    costs = trainings.loc[row.way, SUMMED].astype(float).sum(skipna=False).to_dict()
    seconds = [
        trainings.loc[row.flows, ["render_time_s", "align_time_s"]].to_numpy().sum(),
        trainings.loc[row.corrected, "correct_time_s"].sum(skipna=False),
    ]
    costs["data_time_s"] = float(sum(seconds))
    costs["total_time_s"] = costs["train_time_s"] + costs["data_time_s"]
    costs |= trainings.loc[row.folder, ["params", "memory_mib"]].to_dict()
    table = pd.Series(costs, dtype=object, name="value").rename_axis("metric")
    return table.reset_index().assign(
        method=row.method, round=row.round, test_set=None, view=None
    )


def views_of(path):
    """Scores by view, test set and metric; an empty one could not be had."""
    table = csv_files.read(path, columns=("view", "test_set", "psnr_db"))
    metrics = [name for name in columns.METRICS if name in table]
    return long(table, metrics, path)


def parts_of(path):
    """Lengths of the flow and of its parts, by view; of none without a valid flow."""
    table = csv_files.read(path, columns=("view", *columns.PARTS))
    table = table.dropna(subset=columns.PARTS, how="all")
    return long(table.assign(test_set="standard"), columns.PARTS, path)


def long(table, metrics, path):
    """A row per view, test set and metric; ValueError for one that stands twice."""
    if (twice := table.duplicated(["view", "test_set"])).any():
        raise ValueError(f"{path}: {table['view'][twice].iloc[0]!r} stands twice")
    return table.melt(["view", "test_set"], metrics, "metric", "value")


def line_of(row):
    """A line of trainings.csv."""
    line, files = row._asdict(), row.files
    if "timing" in files:
        # Of another program's training some are not known.
        kinds = dict.fromkeys(TRAINED, json_files.NUMBER_OR_NONE)
        timing = json_files.read(files["timing"], kinds)
        line |= {name: timing[name] for name in TRAINED}
        line |= provenance.of_training(files["timing"])
    if "process" in files:
        line["memory_mib"] = memory_mib(files["process"])
    if "render" in files:
        line["render_time_s"] = rendering_s(files["render"])
        line["align_time_s"] = flow_s(files.get("align"))
    if "corrections" in files:
        seconds = {"time_s": json_files.NUMBER}
        line["correct_time_s"] = json_files.read(files["corrections"], seconds)[
            "time_s"
        ]
    return line


def rendering_s(path):
    """Seconds of all views: loading and compiling count no more than a training's."""
    kinds = dict.fromkeys(("views", "view_time_s"), json_files.NUMBER)
    rendering = json_files.read(path, kinds)
    return rendering["views"] * rendering["view_time_s"]


def flow_s(path):
    """Seconds of all views of a CSV of displacements; NaN where one view has none."""
    return float(csv_files.read(path, columns=["time_s"])["time_s"].sum(skipna=False))


def memory_mib(path):
    """Memory in MiB of Snakemake's benchmark; NaN: not known."""
    table = csv_files.read(path, sep="\t", columns=["max_rss"])
    return pd.to_numeric(table["max_rss"], errors="coerce").iloc[0]


if __name__ == "__main__":
    faults.run(main)
