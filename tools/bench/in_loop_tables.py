"""Tables of what `tools.bench.in_loop` has measured.

    python -m tools.bench.in_loop_tables rows.csv --table in_loop.csv
        --answer equal_time.csv --seconds quiet.csv

The first has a line for each scene, length and method; the second one for each remedy,
as README shows them. Both have gains at as many steps and at equal time. --seconds:
rows of trainings of length 1 beside which nothing ran; one seed of a scene is enough.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.tables import intervals
from tools.bench import reproduction

# Names in tables, and in columns of README's.
SCENES = {
    "both_wrong": ("poses wrong, objects move", "both"),
    "poses_only": ("poses wrong", "poses"),
    "motion_only": ("objects move", "motion"),
    "nothing_wrong": ("nothing wrong", "nothing"),
}
REAL = {
    "chair_crops": "chair, three crops, the phone's poses",
    "chair_adjusted_crops": "chair, the same crops, adjusted poses",
    "chair_colmap_crops": "chair, the same crops, COLMAP's poses",
    "castle": "castle, surveyed cameras, 384x256",
    "castle_off": "castle, off by 1.5 px",
    "fox": "fox, 270x480",
    "fox_off": "fox, off by 1.5 px",
    "flower": "flower, 504x378",
    "treehill": "treehill, 317x208",
    "true": "courtyard, true poses",
}
METHODS = {
    "plain": "plain training",
    "aligned": "aligned in the loop",
    "ten_looks": "aligned in the loop, ten looks",
    "learnt": "poses optimized with the scene",
    "auto": "auto: corrected by flow, then optimized",
    "adjusted_poses": "cameras adjusted before",
    "adjusted_learnt": "cameras adjusted before, then optimized",
    "both": "cameras adjusted, then aligned in the loop",
    "true": "true poses",
}
# Scenes of which one tells how long trainings of the other take.
AS_LONG = {"both_wrong": "poses_only", "nothing_wrong": "motion_only"}
# Times the plain training's steps.
BUDGETS = (1, 2)
ENDS = ("db", "low_db", "high_db")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", type=Path)
    parser.add_argument("--table", type=Path, required=True)
    parser.add_argument("--answer", type=Path)
    parser.add_argument("--seconds", type=Path)
    args = parser.parse_args(argv)
    rows = pd.read_csv(args.rows)
    if args.seconds:
        rows = timed(rows, pd.read_csv(args.seconds))
    table = table_of(rows)
    scenes = REAL | {scene: name for scene, (name, _) in SCENES.items()}
    named = table.replace({"scene": scenes, "method": METHODS})
    named.to_csv(args.table, index=False, float_format="%.4g")
    if args.answer:
        answer_of(rows).to_csv(args.answer, index=False, float_format="%.2f")


def timed(rows, quiet):
    """The rows with the seconds of quiet trainings, each of length 1.

    Looks and adjusting take as long whatever the length; steps in proportion to it.
    """
    of = quiet[quiet["share"] == 1].groupby(["scene", "method"])
    of = of[["train_s", "align_s"]].median()
    scenes = rows["scene"].replace(AS_LONG)
    own = of.loc[
        list(zip(scenes, rows["method"].replace("true", "plain"), strict=True))
    ]
    whole, looks = (own[part].to_numpy() for part in ("train_s", "align_s"))
    steps = (whole - looks) * rows["share"].to_numpy()
    return rows.assign(train_s=looks + steps, align_s=looks)


def table_of(rows):
    """A line for each scene, length and method; gains are over plain training."""
    lines = []
    for scene, own in rows.groupby("scene", sort=False):
        score = "oracle_db" if own["oracle_db"].notna().all() else "fair_db"
        for (share, method), chosen in own.groupby(["share", "method"], sort=False):
            plain = own[(own["share"] == share) & (own["method"] == "plain")]
            line = {"scene": scene, "share": share, "method": method}
            line |= {"test_set": score.removesuffix("_db"), "seeds": 0}
            of_seed = dict(iter(chosen.groupby("seed")))
            line["seeds"] = len(of_seed)
            for key in ("train_s", "align_s", "given_px", "after_px"):
                line[key] = np.median([one[key].iloc[0] for one in of_seed.values()])
            for key in (score, "standard_db", "detail"):
                means = [one[key].mean() for one in of_seed.values()]
                line[key.replace(score, "psnr_db")] = np.mean(means)
            gains, ratios, at_equal, fitted = [], [], [], []
            for seed, one in of_seed.items():
                other = plain[plain["seed"] == seed]
                if other.empty:
                    continue
                gains.append(one[score].to_numpy() - other[score].to_numpy())
                fitted.append(
                    one["fitted_db"].to_numpy() - other["fitted_db"].to_numpy()
                )
                ratios.append(one["train_s"].iloc[0] / other["train_s"].iloc[0])
                at_equal.append(at_equal_time(own, seed, share, method, score))
            if gains and method != "plain":
                line |= with_ends("gain", gains, score)
                if score == "oracle_db":
                    line |= with_ends("fitted", fitted, score)
                line["time_ratio"] = np.median(ratios)
                line["median_gain_db"] = np.median([gain.mean() for gain in gains])
                equal = [gain for gain in at_equal if gain is not None]
                if len(equal) == len(gains):
                    line |= with_ends("equal", equal, score)
            lines.append(line)
    return pd.DataFrame(lines)


def answer_of(rows):
    """A line for each remedy: gains over plain training, by steps and by time.

    The first line is plain training twice as long.
    """
    lines, columns = [], []
    for method in rows["method"].drop_duplicates():
        line = {"remedy": METHODS.get(method, method)}
        if method == "plain":
            line = {"remedy": "plain training, twice as long"}
        for scene, (_, name) in SCENES.items():
            own = dict(iter(rows[rows["scene"] == scene].groupby("seed")))
            of = {"steps": [at_equal_steps(one, method) for one in own.values()]}
            for budget in BUDGETS if method != "plain" else ():
                of[budget] = [
                    at_equal_time(one, seed, budget, method, "oracle_db")
                    for seed, one in own.items()
                ]
            for kind, gains in of.items():
                # The word before `low` is the first one, as in all tables.
                ends = [f"{end}{kind}_db" for end in ("", "low_", "high_")]
                columns += [f"{name}_{end}" for end in ends]
                if gains and all(gain is not None for gain in gains):
                    line |= with_ends(name, gains, "oracle_db", ends)
        lines.append(line)
    return pd.DataFrame(lines, columns=["remedy", *dict.fromkeys(columns)])


def at_equal_steps(rows, method):
    """What a method's views gain after plain training's steps; plain's, after twice."""

    def scores(name, share):
        chosen = rows[(rows["method"] == name) & (rows["share"] == share)]
        return chosen["oracle_db"].to_numpy()

    found = scores(method, 2 if method == "plain" else 1)
    return found - scores("plain", 1) if len(found) else None


def with_ends(name, gains, score, ends=ENDS):
    """{column: mean and ends of its interval} of gains [seeds] of [views]."""
    values = np.mean([gain.mean() for gain in gains]), *interval(gains, score)
    return dict(zip([f"{name}_{end}" for end in ends], values, strict=True))


def interval(gains, score):
    """Over views and seeds; seeds of one capture are of the trainings alone."""
    if score == "fair_db":
        return intervals.mean_interval(np.mean(gains, axis=0))
    return intervals.pooled_interval(gains)


def at_time(points, time_s):
    """The views' scores at a time, of {length: (seconds, scores)}."""
    ordered = sorted(points.values(), key=lambda point: point[0])
    seconds, scores = zip(*ordered, strict=True)
    values = np.stack([one["x"].to_numpy() for one in scores])
    return reproduction.interpolated(np.array(seconds), values, time_s)


def at_equal_time(rows, seed, share, method, score):
    """What a method's views gain at the seconds of plain training; None if unknown.

    Of a method of one length: over plain training of the method's seconds.
    """
    own = rows[rows["seed"] == seed]

    def points(name):
        chosen = own[own["method"] == name].groupby("share")
        return {
            length: (one["train_s"].iloc[0], one[[score]].rename(columns={score: "x"}))
            for length, one in chosen
        }

    plain, own_points = points("plain"), points(method)
    if share not in plain or not own_points:
        return None
    time_s = plain[share][0]
    if len(own_points) == 1 < len(plain):
        time_s = max(time_s, *(seconds for seconds, _ in own_points.values()))
    elif max(own_points) < share:
        return None
    # One that is done a little before the time is up has what it has.
    last_s = max(seconds for seconds, _ in own_points.values())
    found = at_time(own_points, min(time_s, last_s))
    other = at_time(plain, time_s)
    return None if np.isnan(found).any() else found - other


if __name__ == "__main__":
    main()
