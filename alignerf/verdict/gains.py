"""The gains of a run's fixes over its plain training, read from its tables.

And what matches between photos say of the cameras that a fix has corrected.
"""

import math
from pathlib import Path

import numpy as np

from alignerf import testsets
from alignerf.causes.shared.remedies import Gain
from alignerf.io import csv_files, json_files
from alignerf.scenes import prepared
from alignerf.sfm import acceptance, calibration, matches
from alignerf.tables import scores

COLUMNS = ("method", "field", "warping", "test_set", "difference_to", "total_time_s")
COLUMNS += ("moves_cameras", "moves_photos", "params")
COLUMNS += ("difference_db", "difference_low_db", "difference_high_db")


def of_table(path, timings, judgements=()):
    """The `Gain` of each fix in a table over the baseline, the model without one.

    timings: {method: timing.json} of trainings with in-loop alignment. Scores are
    those against the oracle where it is known, else those on held-out photos; where
    cameras were corrected, with held-out ones moved to fit their photos. judgements:
    {method: acceptance.Judgement} of cameras that have moved.
    """
    table = csv_files.read(path, columns=COLUMNS)
    labels = dict(zip(table["method"], table["field"], strict=True))
    called = names(table)
    # Of moved cameras that no photo fixes there are no scores.
    gains, known = [], {*table["test_set"][table["difference_db"].notna()]}
    for row in table.itertuples():
        is_base = (row.method, row.warping) == (row.difference_to, scores.warping(0))
        # What it moves is unknown of published rows.
        pairs = ("cameras", row.moves_cameras), ("photos", row.moves_photos)
        moves = {what for what, is_moved in pairs if is_moved is True}
        fair = row.test_set == testsets.fairest(known, moves)
        if is_base or not fair or math.isnan(row.difference_db):
            continue
        timing, judgement = timings.get(row.method), dict(judgements).get(row.method)
        changed = "cameras corrected" if moves == {"cameras"} else "warped"
        name = scores.row_name(called[row.method], row.warping, changed)
        if timing and called[row.method] == row.method:
            # What a method that aligns itself is, besides what its baseline is.
            baseline = f"{labels.get(row.difference_to)}, "
            name = f"{name}, {str(row.field).removeprefix(baseline)}"
        gains.append(
            Gain(
                *(name, row.difference_db),
                *(row.difference_low_db, row.difference_high_db),
                *(row.total_time_s / 60, row.method, "cameras" in moves, row.test_set),
                cameras_moved=cameras_moved(timing) if timing else None,
                warped="photos" in moves,
                matches=judgement and judgement.told(),
            )
        )
    return gains


def names(table):
    """{method: its name in words}: what it is for, where no other method is that.

    Of two baselines one is called the large model.
    """
    found = {}
    bases = table[table["method"] == table["difference_to"]]
    sizes = bases.groupby("method")["params"].max().sort_values()
    plain = dict.fromkeys(sizes.index, "plain")
    if len(sizes) == 2 and sizes.is_unique:
        plain = dict(zip(sizes.index, ("small model", "large model"), strict=True))
    for row in table.itertuples():
        if row.method in plain:
            found[row.method] = plain[row.method]
        elif (row.moves_cameras, row.moves_photos) == (True, False):
            found[row.method] = "corrected cameras"
    words = [*found.values()]
    own = {m: name for m, name in found.items() if words.count(name) == 1}
    return {method: own.get(method, method) for method in table["method"]}


def cameras_moved(timing):
    """How many cameras a training has moved at one stop at the most; None: unknown."""
    kinds = {
        "alignments": json_files.OrNone(
            [{"cameras_moved": json_files.OrNone(json_files.NUMBER)}]
        )
    }
    stops = json_files.read(timing, kinds).get("alignments") or []
    counts = [stop.get("cameras_moved") for stop in stops]
    return max((n for n in counts if n is not None), default=None)


def judgements(scene, paths):
    """{method: acceptance.Judgement} of corrected cameras, by matches unseen by them.

    scene: its folder; paths: {method: cameras.npz}. Empty where the scene has no
    matches. A view that a method has left where it was says nothing of it, so that
    matches count between two that it learnt from.
    """
    path = Path(scene) / matches.FILE
    if not (paths and path.is_file()):
        return {}
    found = matches.load(path)
    own = prepared.read_cameras(Path(scene) / "cameras.npz")
    poses = prepared.read_poses(scene)
    learnt = found.between(own["split"] == "train")
    photo_px = poses["photo_width"] / found.width
    before = cameras_of(own, found)
    return {
        name: acceptance.judge(
            learnt, before, cameras_of(prepared.read_cameras(cameras), found), photo_px
        )
        for name, cameras in paths.items()
    }


def cameras_of(arrays, found) -> calibration.Cameras:
    """The pinhole cameras of a cameras.npz, in px of matches."""
    ratios = found.width / arrays["width"], found.height / arrays["height"]
    lenses, none = np.linalg.inv(arrays["pixtocams"]), np.zeros((len(found.names), 5))
    return calibration.Cameras(lenses, arrays["camtoworlds"], none).scaled(ratios)
