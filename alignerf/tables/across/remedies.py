"""Remedies compared at equal time: `python -m alignerf.tables.across.remedies`.

A remedy is a method that may bring more than plain training: photos warped, cameras put
right or learnt, AligNeRF. Each remedy is trained at several lengths. The score at any
time is interpolated between these lengths, linearly in the logarithm of the time. The
time is that of every training, rendering and flow of the remedy, without compilation.

Writes CSV, LaTeX and a figure. A line has a condition (scenes that differ in seed and
length only), a budget (1, 2 and 4 times the plain training's time), a remedy and a test
set; the score, and the gain over plain training of the same time. Gains are paired by
view; 95 % intervals are over views and, if there are several, seeds. A remedy has no
line where the budget lies more than 5 % outside the times that it was trained for.

Where the config has one capture at several photo sizes, the figure shows gains by size:
misalignment is fixed in angle, so it grows in pixels (paper, Table 2).
"""

from pathlib import Path

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.io import atomic, faults, json_files
from alignerf.tables import columns, costs, frame, latex, plots, scores

# Without the warped test set: each length has its own, so its scores do not compare.
TEST_SETS = testsets.shown_in("remedies")
# In units of the plain training's time.
BUDGETS = (1, 2, 4)
# Seconds of equal trainings differ by up to this factor from run to run.
SLACK = 1.05
NOTES = (
    "PSNR in dB at equal total time, and its difference to plain training of",
    "the same time, paired by view; 95 % intervals; bold: the interval excludes 0.",
)


def main(argv=None):
    args = faults.arguments(argv, __doc__, frame.OPTIONS | frame.FIGURE)
    views = frame.read_scenes(args, "remedies")
    table = make_table(views, args.results)
    captures = by_capture(views)
    with atomic.replace_file(args.figure) as path:
        if captures:
            plots.sizes(table, captures, path)
        else:
            plots.costs(costs.points(views), path)
        frame.write_across(table, to_latex, views, args)


def by_capture(views):
    """Lists of condition names: a list for each capture with several photo sizes."""
    conditions = views.drop_duplicates("alike")
    names = conditions.groupby("capture", sort=False)["scene"].agg(list)
    return [own for own in names if len(own) > 1]


def make_table(views, results):
    """Lines of all conditions, remedies and budgets; results: the scenes' folder."""
    lines = []
    for _, condition in views.groupby("alike", sort=False):
        scenes = condition.drop_duplicates("scene")
        for name, again in zip(
            scenes["scene"], scenes.duplicated(["seed", "share"]), strict=True
        ):
            if again:
                raise ValueError(f"{name}: the same as another scene")
        lines += lines_of(condition, Path(results))
    return pd.DataFrame(lines, columns=columns.names("remedies"))


def size_of(plain, results):
    """Size of the photos, and length of the flow of the plain trainings' renders.

    flow_px: the mean over seeds of the median over views of each view's median length.
    """
    keys = dict.fromkeys(
        ("width_px", "height_px", "pixel_angle_mrad"), json_files.NUMBER
    )
    scenes = plain.drop_duplicates("scene")
    paths = [results / scene / "facts.json" for scene in scenes["scene"]]
    facts = pd.DataFrame([json_files.read(path, keys) for path in paths])
    flow_px = scenes["flow_px"].to_numpy(float)
    return {
        # Seeds share the photos' size; only the flow is averaged.
        "width_px": facts["width_px"][0],
        "height_px": facts["height_px"][0],
        "flow_px": np.mean(flow_px),
        "flow_mrad": np.mean(flow_px * facts["pixel_angle_mrad"].to_numpy()),
    }


def lines_of(condition, results):
    """Lines of one condition: of scenes that differ in seed and length."""
    remedies = ["method", "round", "description"]
    seeds = condition["seed"].nunique()
    has = condition.groupby(remedies)["seed"].transform("nunique") == seeds
    rows = list(condition[has].groupby(remedies, sort=False))
    plain = rows[0][1]
    whole = plain[plain["share"] == 1]
    labels = {"condition": condition["scene"].iloc[0], "seeds": seeds}
    labels |= size_of(whole, results)
    known = frame.known(plain[plain["seed"] == plain["seed"].iloc[0]])
    for budget in BUDGETS:
        times = plain[plain["share"] == budget].drop_duplicates("seed")
        if len(times) < seeds:
            continue
        times_s = dict(zip(times["seed"], times["total_time_s"], strict=True))
        for (method, round, parts), own in rows:
            named = labels | {"budget": budget, "time_s": np.mean([*times_s.values()])}
            named |= {"method": method, "warping": scores.warping(round)}
            for test_set in TEST_SETS:
                pairs = [
                    [
                        at_time(one[one["seed"] == seed], time_s, test_set)
                        for one in (own, plain)
                    ]
                    for seed, time_s in times_s.items()
                ]
                if not any(np.isnan(at).all() for at, _ in pairs):
                    found = gain_of(pairs, same_photos="oracle" not in known)
                    yield named | {"parts": parts, "test_set": test_set} | found


def gain_of(pairs, *, same_photos):
    """Score and gain of [(PSNR of views, that of plain training)], one pair a seed.

    same_photos: seeds change the training alone, not the photos. Gains are then
    averaged over seeds first, so that each view counts once in the interval.
    """
    gains = [own - other for own, other in pairs]
    if same_photos:
        gains = [np.mean(gains, axis=0)]
    return {
        "psnr_db": np.mean([own.mean() for own, _ in pairs]),
        "views": sum(map(len, gains)),
        **scores.pooled_mean_and_interval(gains, "gain_"),
    }


def at_time(own, time_s, test_set):
    """PSNR in dB of the views [n] at a time; NaN outside the times of the trainings.

    own: lines of one method and seed, of all its lengths.
    """
    lines = own[own["test_set"] == test_set]
    if lines["share"].nunique() < own["share"].nunique():
        return np.array([np.nan])
    wide = lines.pivot(
        index=["total_time_s", "share"], columns="view", values="psnr_db"
    ).sort_index(level="total_time_s")
    return interpolated(
        wide.index.get_level_values(0).to_numpy(), wide.to_numpy(), time_s
    )


def interpolated(seconds, psnr_db, time_s):
    """dB of the views [n] at a time; psnr_db: [lengths, n] after rising seconds."""
    if not seconds[0] / SLACK <= time_s <= seconds[-1] * SLACK:
        return np.full(psnr_db.shape[1], np.nan)
    at = np.log(np.clip(time_s, seconds[0], seconds[-1]))
    return np.array([np.interp(at, np.log(seconds), view) for view in psnr_db.T])


def to_latex(table):
    """A block for each condition, a row for each remedy, budgets as columns."""
    blocks = []
    for name, lines in table.groupby("condition", sort=False):
        chosen = testsets.fairest(set(lines["test_set"]))
        lines = lines[lines["test_set"] == chosen]
        minutes = lines.groupby("budget")["time_s"].first() / 60
        title = ", ".join(f"{one:.1f}" for one in minutes)
        title = f"{latex.name(name)}, {chosen}: {title} min"
        names = scores.short_names(lines["method"], lines["warping"])
        blocks.append(lines.assign(title=title, remedy=list(map(latex.name, names))))
    table = pd.concat(blocks, ignore_index=True)
    return latex.of_lines(
        table,
        {"Condition": table["title"], "Remedy": table["remedy"]},
        [("psnr_db", "PSNR", ".2f"), ("gain_db", "gain", "interval")],
        by="budget",
        values=sorted(set(table["budget"])),
        notes=NOTES,
    )


if __name__ == "__main__":
    faults.run(main)
