"""What a run's remedies brought: gains over its plain training, and their sentences."""

from typing import NamedTuple

import pandas as pd

from alignerf import testsets
from alignerf.files import csv_files, json_files
from alignerf.tables import scores
from alignerf.verdict import shift


class Gain(NamedTuple):
    """A remedy's gain in this run, in dB with its interval, and its minutes."""

    name: str
    db: float
    low: float
    high: float
    minutes: float
    method: str = ""
    # Whether it has moved its cameras: on the way, or between rounds.
    on_the_way: bool = False
    test_set: str = ""
    # Of a training that aligned itself: how many cameras it has moved at the most.
    cameras_moved: int | None = None
    # Whether it has warped its photos, by either.
    warped: bool = False
    # What held-out matches say of its cameras (`acceptance.Judgement.told`).
    matches: dict | None = None


OF_GAINS = ("method", "warping", "test_set", "difference_to", "total_time_s")
OF_GAINS += ("moves_cameras", "moves_photos")
OF_GAINS += ("difference_db", "difference_low_db", "difference_high_db")


def is_on_the_way(gain):
    """Whether a remedy moves cameras."""
    return gain.on_the_way


def of_table(path, timings, judgements=()):
    """The `Gain` of each remedy in a table over the baseline, the model without one.

    timings: {method: timing.json} of trainings that aligned themselves. Scores are
    those against the oracle where it is known, else those on held-out photos; where
    cameras were put right, with held-out ones moved to fit their photos. judgements:
    {method: acceptance.Judgement} of cameras that have moved.
    """
    table = csv_files.read(path, columns=OF_GAINS)
    known = set(table["test_set"])
    # Of published rows it is not known.
    moves = [
        {name for name in ("cameras", "photos") if row[f"moves_{name}"] is True}
        for row in table.to_dict("records")
    ]
    fair = [testsets.fairest(known, moved) for moved in moves]
    chosen = table[table["test_set"] == fair]
    gains = []
    for row in chosen.itertuples():
        own = row.method == row.difference_to and row.warping == scores.warping(0)
        if own or pd.isna(row.difference_db):
            continue
        name = scores.row_name(row.method, row.warping)
        timing = timings.get(row.method)
        if timing and not row.method.startswith("aligned"):
            name = f"{name}, aligned on the way"
        ends = (row.difference_low_db, row.difference_high_db)
        took = row.total_time_s / 60, row.method, row.moves_cameras, row.test_set
        count = cameras_moved(timing) if timing else None
        judged = dict(judgements).get(row.method)
        told = judged and judged.told()
        gains.append(
            Gain(name, row.difference_db, *ends, *took, count, row.moves_photos, told)
        )
    return gains


def cameras_moved(timing):
    """How many cameras a training has moved at one stop at the most; None: unknown."""
    stops = json_files.read(timing, {}).get("alignments") or []
    counts = [stop.get("cameras_moved") for stop in stops]
    return max((n for n in counts if n is not None), default=None)


# What a gain is measured against, by test set.
CALLED_SETS = {
    "oracle": " against the true scene",
    "standard": " on held-out photos",
    "aligned_pose": " on held-out photos, each by a camera moved to fit it,",
}


def line(gain, e):
    """A sentence on a remedy's gain in this run; it claims nothing from few views."""
    name, db, low, high, minutes = gain[:5]
    took = f"{minutes:.0f} min" if minutes >= 1 else "under a minute"
    against = CALLED_SETS.get(gain.test_set, "")
    if gain.test_set == "standard" and is_on_the_way(gain):
        against += " by cameras that were left as given: true gains are larger,"
    text = f"{name}: {db:+.2f} dB [{low:+.2f}, {high:+.2f}]{against} in {took}"
    if gain.matches and gain.matches["accepted"]:
        change = "{before_px:.2f} -> {after_px:.2f} px".format(**gain.matches)
        text += f", held-out matches {change}"
    if gain.cameras_moved == 0:
        text += ", without moving a camera"
    if e.test_views < shift.FEW_TEST_VIEWS:
        return f"{text}; {e.test_views} held-out photos are too few to be sure."
    if low > 0 or high < 0:
        return f"{text}."
    return f"{text}: not more than chance."
