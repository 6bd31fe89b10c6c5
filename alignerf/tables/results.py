"""Read scores.csv and trainings.csv, as `tables.collect` wrote them, as `Row`s."""

from pathlib import Path
from typing import NamedTuple

import pandas as pd

from alignerf.files import csv_files, provenance
from alignerf.tables import columns, scores

# Summed over all trainings that lead to a row.
SUMMED = ("train_time_s", "steps", "rays_seen")


class Row(NamedTuple):
    """A method after a round, or an external method's renders.

    views: scores, a row for each test view, columns (test set, metric). base: `views`
    of the baseline's round 0. own: the method's line of trainings.csv. before: the line
    of the round before, or None. costs: seconds, steps and rays of all trainings that
    lead to the round, and the number of its parameters; empty for external renders.
    trainings: path and `provenance.KEYS` of each of these trainings.
    """

    scene: str
    method: str
    round: int
    description: str
    baseline: str
    published: str | None
    views: pd.DataFrame
    base: pd.DataFrame
    own: pd.Series
    before: pd.Series | None
    costs: dict
    trainings: list

    @property
    def warping(self):
        """The paper's word for the number of rounds: `none`, `once`, `twice`."""
        return scores.warping(self.round)

    def psnr_db(self, needed=()):
        """PSNR in dB, a row for each view and a column for each test set.

        Raises ValueError where a test set of `needed` has no column.
        """
        table = self.views.xs("psnr_db", axis=1, level=1)
        for name in needed:
            if name not in table:
                what = row_name((self.method, self.round))
                raise ValueError(f"{self.scene}: {what}: no test set {name!r}")
        return table


def row_name(key):
    """The name of a (method, round) in error messages."""
    return " after round ".join(map(str, key))


def read(scene, table=""):
    """The rows of a scene's folder, in the order of its trainings.csv.

    table: the folder, below the scene's, of a table across scenes; "" for the scene's
    own tables. Raises ValueError with the file's name where the two files disagree.
    """
    path = Path(scene) / table / "trainings.csv"
    views = read_scores(path.with_name("scores.csv"))
    lines = csv_files.read(path, columns=columns.names("trainings"))
    named = lines[lines["method"].notna()]
    try:
        if named.duplicated(["method", "round"]).any():
            raise ValueError("a method and round stands twice")
        # Two methods may share a training: each has a line of its own.
        trainings = lines.drop_duplicates("folder").set_index("folder", drop=False)
        rows = [
            row_of(line, trainings, views, Path(scene)) for _, line in named.iterrows()
        ]
        if others := set(views) - {(row.method, row.round) for row in rows}:
            raise ValueError(f"it has no {row_name(min(others, key=str))}")
    except (KeyError, ValueError, TypeError, OverflowError) as error:
        beside = path.with_name("scores.csv").name
        raise ValueError(f"{path}: does not go with {beside}: {error}") from None
    return rows


def row_of(line, trainings, views, scene):
    """The `Row` of a line of trainings.csv.

    Raises KeyError for a folder without a line, ValueError for a row without scores.
    """
    base = trainings.loc[line["base"]]
    key, base_key = ((one["method"], int(one["round"])) for one in (line, base))
    for name in (key, base_key):
        if name not in views:
            raise ValueError(f"no scores of {row_name(name)}")
    return Row(
        scene=scene.name,
        method=key[0],
        round=key[1],
        description=line["description"],
        baseline=line["baseline"],
        published=line["published"] if has(line, "published") else None,
        views=views[key],
        base=views[base_key],
        own=line,
        before=trainings.loc[line["before"]] if has(line, "before") else None,
        costs=costs_of(trainings, line),
        trainings=[
            {"path": str(scene / folder / "timing.json")}
            | told_of(trainings.loc[folder])
            for folder in words(line, "way")
        ],
    )


def read_scores(path):
    """{(method, round): table of scores}; a table is laid out as `Row.views`."""
    *keys, value = columns.names("scores")
    table = csv_files.read(path, columns=(*keys, value))
    if table.duplicated(keys).any():
        raise ValueError(f"{path}: a score stands twice")
    if unknown := set(table["metric"]) - {*columns.METRICS, *columns.PARTS}:
        raise ValueError(f"{path}: no metric is called {min(unknown, key=str)}")
    found, views = {}, None
    for key, own in table.groupby(["method", "round"], sort=False):
        wide = own.pivot(index="view", columns=["test_set", "metric"], values=value)
        views = wide.index if views is None else views
        if not wide.index.equals(views):
            raise ValueError(f"{path}: {row_name(key)}: not the views of those above")
        # Every test set gets a column for every metric; a missing metric is NaN.
        sets = wide.columns.get_level_values(0).unique()
        whole = [(name, metric) for name in sets for metric in columns.METRICS]
        more = [column for column in wide if column not in set(whole)]
        found[key] = wide.reindex(columns=pd.MultiIndex.from_tuples([*whole, *more]))
    return found


def told_of(line):
    """{key: value} of `provenance.KEYS` of a training; None for an unknown value."""
    return {key: line[key] if has(line, key) else None for key in provenance.KEYS}


def costs_of(trainings, line):
    """Costs, summed over the trainings that lead to a row; parameters of the last."""
    way = words(line, "way")
    if not way:
        return {}
    costs = {key: trainings.loc[way, key].sum(skipna=False) for key in SUMMED}
    flows, corrected = words(line, "flows"), words(line, "corrected")
    seconds = [
        trainings.loc[flows, ["render_time_s", "align_time_s"]].to_numpy().sum(),
        trainings.loc[corrected, "correct_time_s"].sum(skipna=False),
    ]
    costs["data_time_s"] = float(sum(seconds))
    costs["total_time_s"] = costs["train_time_s"] + costs["data_time_s"]
    return costs | {"params": line["params"]}


def words(line, key):
    """The folders in a cell."""
    return line[key].split() if has(line, key) else []


def has(line, key):
    """Whether a cell of a line has something in it."""
    return pd.notna(line[key])
