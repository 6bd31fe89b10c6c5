"""A scene's scores and costs as a frame, of which every table is a query.

A line is a test view of a row (a method after a round) on a test set. Its columns:

scene, method, round, test_set, view     which one it is
psnr_db, ...; flow_median_px, ...        its scores, and lengths of its flow
base_db                                  PSNR of the view by the baseline's round 0
description, baseline, published, ...    names of the row, as in trainings.csv
train_time_s, total_time_s, ...          costs of all that leads to the row

`read_scenes` adds the fields of `Scene`, and as `reference_db` the PSNR of the view by
the reference's round 0.
"""

from pathlib import Path

import pandas as pd

from alignerf import testsets
from alignerf.io import csv_files, provenance
from alignerf.tables import columns, scores

ROW = ["method", "round"]
VIEW = ["scene", "test_set", "view"]
NAMES = ["description", "baseline", "base", "published"]
NAMES += ["moves_cameras", "moves_photos"]
COSTS = ["train_time_s", "steps", "rays_seen", "data_time_s", "total_time_s"]
COSTS += ["params", "memory_mib"]


def read(scene, table=""):
    """The frame of a scene's folder, its rows in the order of its trainings.csv.

    table: the folder, below the scene's, of a table across scenes; "" for the scene's
    own tables.
    """
    path = Path(scene) / table / "scores.csv"
    long = csv_files.read(path, columns=columns.names("scores"))
    if (long["view"].isna() != long["test_set"].isna()).any():
        raise ValueError(f"{path}: a score is of a view and a test set, a cost of none")
    rows = read_trainings(scene, table).dropna(subset="method")[[*ROW, *NAMES]]
    rows = rows.astype({"round": int}).assign(scene=Path(scene).name)
    costs = long[long["test_set"].isna()]
    costs = costs.pivot(index=ROW, columns="metric", values="value")
    rows = rows.join(costs.reindex(columns=COSTS), on=ROW)
    views = rows.merge(wide(long.dropna(subset="test_set")), on=ROW)
    if lost := {*rows["method"]} - {*views["method"]}:
        raise ValueError(f"{path}: no scores of {min(lost)}")
    views["base"] = views["base"].str.partition("/")[0]
    first = views[views["round"] == 0].set_index(["method", "test_set", "view"])
    base_db = first["psnr_db"].rename("base_db")
    return views.join(base_db, on=["base", "test_set", "view"])


def read_trainings(scene, table=""):
    """trainings.csv of a scene's folder, or of a table across scenes there."""
    path = Path(scene) / table / "trainings.csv"
    return csv_files.read(path, columns=columns.names("trainings"))


def wide(long):
    """Scores by row, test set, in the tables' order, and view: a column a metric."""
    *keys, metric, value = columns.names("scores")
    order = {one.name: place for place, one in enumerate(testsets.every())}
    sets = long[[*ROW, "test_set"]].drop_duplicates()
    sets = sets.sort_values("test_set", key=lambda s: s.map(order), kind="stable")
    # A view that lacks a test set of its row has a line, and no scores in it.
    full = sets.merge(pd.DataFrame({"view": sorted(set(long["view"]))}), how="cross")
    found = long.pivot(index=keys, columns=metric, values=value)
    metrics = [*columns.METRICS, *columns.PARTS]
    index = pd.MultiIndex.from_frame(full[keys])
    return found.reindex(index, columns=metrics).reset_index()


def psnr_by_set(own, needed=()):
    """PSNR in dB of one row's lines: a row a view, a column a test set.

    Raises ValueError where a test set of `needed` has no column.
    """
    known = own["test_set"].unique()
    for name in needed:
        if name not in known:
            scene, *key = own.iloc[0][["scene", *ROW]]
            row = " after round ".join(map(str, key))
            raise ValueError(f"{scene}: {row}: no test set {name!r}")
    return own.pivot(index="view", columns="test_set", values="psnr_db")[known]


def summary(views, by, at, *, against="base_db", metrics=columns.METRICS):
    """A line for each of the columns `by`, and each test set of `at` that it has.

    A test set counts where all scenes have it. A line has the names of its first view,
    means over scenes of costs and of metrics, and what PSNR gains over the column
    `against`, paired by view; against: also {prefix of the gain: column}, of which None
    stands for PSNR itself.
    """
    if isinstance(against, str):
        against = {"difference_": against}
    for _, own in views.groupby(by, sort=False):
        line = labels_of(own) | mean_costs(own) | {"scenes": own["scene"].nunique()}
        for test_set, lines in sets_of_all(own, at):
            lines = scored(lines, test_set)
            line |= {"test_set": test_set, "views": len(lines)} | means(lines, metrics)
            for prefix, column in against.items():
                line |= gains(lines, column, prefix)
            yield dict(line)


def scored(own, test_set):
    """Lines of a test set; of a partial one without views that it has no pixel of."""
    lines = own[own["test_set"] == test_set]
    if testsets.named(test_set).partial:
        lines = lines.dropna(subset=[*columns.METRICS], how="all")
    return lines


def labels_of(own):
    """What tables call a row, and all that its first line says of it."""
    first = own.iloc[0].to_dict()
    called = {"warping": scores.warping(first["round"]), "field": first["description"]}
    return first | called | {"difference_to": first["baseline"]}


def shared(views, within=()):
    """The rows that all scenes have; within: columns of groups of scenes."""
    counts = views.groupby([*within, *ROW])["scene"].transform("nunique")
    every = views["scene"].nunique()
    if within:
        every = views.groupby(within)["scene"].transform("nunique")
    return views[counts == every]


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


def mean_costs(own):
    """{cost: mean over scenes}."""
    return own.drop_duplicates("scene")[COSTS].mean(skipna=False).to_dict()


def gains(own, other, prefix="difference_"):
    """The mean of psnr_db less the column `other`, view by view, with its interval.

    own: lines of one test set.
    """
    gain_db = own["psnr_db"] - own[other] if other else own["psnr_db"]
    if len(own) and testsets.named(own["test_set"].iloc[0]).moved:
        gain_db = gain_db.dropna()
    groups = [one.to_numpy() for _, one in gain_db.groupby(own["scene"], sort=False)]
    return scores.pooled_mean_and_interval(groups, prefix)


def read_scenes(scenes, results, table=""):
    """The frame of all `Scene`s in a folder of results, with what each is like."""
    frames = [
        read(Path(results) / scene.scene, table).assign(**scene._asdict())
        for scene in scenes
    ]
    return with_reference(pd.concat(frames, ignore_index=True))


def with_reference(views):
    """The lines of scenes with `reference_db`."""
    return beside(views, of_reference(views), "reference_db")


def of_reference(views):
    """The lines of the reference's round 0."""
    return views[(views["method"] == views["reference"]) & (views["round"] == 0)]


def origins(scene, table=""):
    """Path and `provenance.KEYS` of each training that a scene's tables are made of."""
    found = read_trainings(scene, table).drop_duplicates("folder")
    paths = [str(Path(scene) / folder / "timing.json") for folder in found["folder"]]
    keys = found[[*provenance.KEYS]].astype(object)
    keys = keys.where(keys.notna(), None)
    return keys.assign(path=paths).to_dict("records")
