"""Scores joined with trainings: a frame of which every table is a query.

A line is a test view of a row (a method after a round, or the renders of an external
method) on a test set. Its columns:

scene, method, round, test_set, view     which one it is
psnr_db, ...; flow_median_px, ...        its scores, and lengths of its flow
base_db                                  PSNR of the view by the baseline's round 0
train_time_s, data_time_s, total_time_s, steps, rays_seen
                                         of all trainings that lead to the row
trainings                                path and `provenance.KEYS` of each training

and all others of trainings.csv. Tables across scenes add the fields of `Scene`, the
length of a scene's training as `scene_steps`.
"""

import contextlib
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.experiment.tables import rows as table_rows
from alignerf.experiment.tables.scenes import Scene
from alignerf.io import atomic, csv_files, provenance
from alignerf.tables import columns, latex, scores

ROW = ["method", "round"]
LABELS = ["scene", *ROW]
VIEW = ["scene", "test_set", "view"]
# Summed over all trainings that lead to a row.
SUMMED = ["train_time_s", "steps", "rays_seen"]
COSTS = [*SUMMED, "data_time_s", "total_time_s", "params"]


def read(scene, table=""):
    """The frame of a scene's folder, its rows in the order of its trainings.csv.

    table: the folder, below the scene's, of a table across scenes; "" for the scene's
    own tables.
    """
    path = Path(scene) / table / "trainings.csv"
    views = read_scores(path.with_name("scores.csv"))
    lines = csv_files.read(path, columns=columns.names("trainings"))
    named = lines[lines["method"].notna()]
    # Two methods may share a training: each has a line of its own.
    trainings = lines.drop_duplicates("folder").set_index("folder", drop=False)
    rows = [row_of(line, trainings, views, Path(scene)) for _, line in named.iterrows()]
    return pd.concat(rows, ignore_index=True)


def row_of(line, trainings, views, scene):
    """The lines of a row: of a line of trainings.csv, and its `read_scores`."""
    base = trainings.loc[line["base"]]
    key, base_key = ((one["method"], int(one["round"])) for one in (line, base))
    own, base_db = views[key], views[base_key]["psnr_db"]
    of_row = line.to_dict() | {"scene": scene.name, "round": key[1]}
    of_row |= costs_of(trainings, line)
    told = [
        {"path": str(scene / folder / "timing.json")}
        | {k: trainings.loc[folder, k] for k in provenance.KEYS}
        for folder in words(line, "way")
    ]
    told = [{k: None if pd.isna(v) else v for k, v in one.items()} for one in told]
    found = own.assign(base_db=base_db).reset_index().assign(**of_row)
    return found.assign(trainings=[told] * len(found))


def costs_of(trainings, line):
    """Costs, summed over the trainings that lead to a row; empty of given renders."""
    way = words(line, "way")
    if not way:
        return dict.fromkeys(COSTS, np.nan)
    costs = {key: trainings.loc[way, key].sum(skipna=False) for key in SUMMED}
    flows, corrected = words(line, "flows"), words(line, "corrected")
    seconds = [
        trainings.loc[flows, ["render_time_s", "align_time_s"]].to_numpy().sum(),
        trainings.loc[corrected, "correct_time_s"].sum(skipna=False),
    ]
    costs["data_time_s"] = float(sum(seconds))
    return costs | {"total_time_s": costs["train_time_s"] + costs["data_time_s"]}


def words(line, key):
    """The folders in a cell."""
    return line[key].split() if pd.notna(line[key]) else []


def row_name(key):
    """The name of a (method, round) in error messages."""
    return " after round ".join(map(str, key))


def read_scores(path):
    """{(method, round): scores by test set, in the tables' order, and view}."""
    *keys, metric, value = columns.names("scores")
    table = csv_files.read(path, columns=(*keys, metric, value))
    wide = table.pivot(index=keys, columns=metric, values=value)
    # A view that lacks a test set of its row has a line, and no scores in it.
    order = {one.name: place for place, one in enumerate(testsets.every())}
    sets = table[[*ROW, "test_set"]].drop_duplicates()
    sets = sets.sort_values("test_set", key=lambda s: s.map(order), kind="stable")
    full = sets.merge(pd.DataFrame({"view": sorted(set(table["view"]))}), how="cross")
    metrics = [*columns.METRICS, *(name for name in columns.PARTS if name in wide)]
    wide = wide.reindex(pd.MultiIndex.from_frame(full[keys]), columns=metrics)
    rows = wide.groupby(level=ROW, sort=False)
    return {key: own.droplevel(ROW) for key, own in rows}


def psnr_by_set(own, needed=()):
    """PSNR in dB of one row's lines: a row a view, a column a test set.

    Raises ValueError where a test set of `needed` has no column.
    """
    known = own["test_set"].unique()
    for name in needed:
        if name not in known:
            scene, *key = own.iloc[0][LABELS]
            raise ValueError(f"{scene}: {row_name(key)}: no test set {name!r}")
    return own.pivot(index="view", columns="test_set", values="psnr_db")[known]


def rows_of(frame):
    """(labels, lines) of every row of one scene, in order."""
    for (method, round), own in frame.groupby(ROW, sort=False):
        yield {"method": method, "warping": scores.warping(round)}, own


def shared(frame):
    """The rows that all scenes have."""
    counts = frame.groupby(ROW)["scene"].transform("nunique")
    return frame[counts == frame["scene"].nunique()]


def sets_of_all(own, names):
    """(test set, lines) of these test sets, if all scenes have them."""
    of_all = known(own)
    for name in names:
        if name in of_all:
            yield name, own[own["test_set"] == name]


def known(own):
    """The test sets that all scenes of some lines have."""
    counts = own.groupby("test_set")["scene"].nunique()
    return set(counts.index[counts == own["scene"].nunique()])


def beside(own, other, name, on=VIEW):
    """Lines with a column of another row's PSNR of the same views."""
    return own.join(other.set_index(on)["psnr_db"].rename(name), on=on)


def means(own, metrics):
    """{metric: mean over scenes of the means over views}.

    A view without a metric leaves the mean empty rather than flatter it.
    """
    by_scene = own.groupby("scene", sort=False)[list(metrics)].mean(skipna=False)
    return by_scene.mean(skipna=False).to_dict()


def mean_costs(own, names):
    """{cost: mean over scenes}."""
    return own.drop_duplicates("scene")[list(names)].mean(skipna=False).to_dict()


def gains(own, other, prefix="difference_"):
    """The mean of psnr_db less the column `other`, view by view, with its interval."""
    gain_db = own["psnr_db"] - own[other] if other else own["psnr_db"]
    groups = [one.to_numpy() for _, one in gain_db.groupby(own["scene"], sort=False)]
    return scores.pooled_mean_and_interval(groups, prefix)


# Of a command that makes a table across scenes.
OPTIONS = {
    "scenes": "JSON: what each is like",
    "[results]": ("where they lie", "results"),
    "[configs]": ("YAML: complete ones", {"nargs": "*", "default": []}),
    "csv": "table; its provenance beside it",
    "tex": "table, written",
}
FIGURE = {"figure": "PNG, written"}


def read_scenes(args, table):
    """The frame of all scenes of the arguments of `parser`, with what each is like."""
    frames = []
    for scene in table_rows.read(Scene, args.scenes):
        fields = scene._asdict() | {"scene_steps": scene.steps}
        del fields["steps"]
        frames.append(read(Path(args.results) / scene.scene, table).assign(**fields))
    return pd.concat(frames, ignore_index=True)


def write(table, to_latex, *, csv, tex, frame, configs):
    """Write a table as CSV and as to_latex has it, and its provenance; all or none.

    frame: that it was made of. configs: the scenes' complete configs.
    """
    text = latex.document(to_latex(table))
    table = without_empty(table)
    rows = frame.drop_duplicates(LABELS)[[*LABELS, "trainings"]].to_dict("records")
    found = provenance.describe(rows, configs)
    beside = provenance.path_beside(csv)
    with contextlib.ExitStack() as stack:
        csv, tex, origin = (
            stack.enter_context(atomic.replace_file(path))
            for path in (csv, tex, beside)
        )
        table.to_csv(csv, index=False, float_format="%.6g")
        tex.write_text(text)
        origin.write_text(provenance.as_json(found))


def without_empty(table):
    """A table without the columns of networks that had no weights."""
    known = [name for name in columns.NETWORKS if name in table]
    return table.drop(columns=[n for n in known if table[n].isna().all()])


def write_across(table, to_latex, frame, args):
    """The same of a table across scenes, by the arguments of `parser`."""
    places = {"csv": args.csv, "tex": args.tex, "configs": args.configs}
    write(table, to_latex, frame=frame, **places)
