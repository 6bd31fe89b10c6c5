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

from typing import NamedTuple

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.files import atomic, faults, json_files
from alignerf.tables import columns, latex, scores
from alignerf.tables import files as table_files
from alignerf.tables.plots import remedies as remedies_plot
from alignerf.tables.plots import sizes as sizes_plot

# Without the warped test set: each length has its own, so its scores do not compare.
TEST_SETS = testsets.shown_in("remedies")
# In units of the plain training's time.
BUDGETS = (1, 2, 4)
# Seconds of equal trainings differ by up to this factor from run to run.
SLACK = 1.05
FLOW = ("flow_px", "flow_mrad")
NOTES = (
    "PSNR in dB at equal total time, and its difference to plain training of",
    "the same time, paired by view; 95 % intervals; bold: the interval excludes 0.",
)


class Condition(NamedTuple):
    """Scenes that differ in seed and length only."""

    name: str
    # `Scene.capture`: equal for conditions that differ only in the photos' size.
    capture: str
    # {seed: {(method, round, parts): {share: (seconds, PSNR of views by test set)}}}
    seeds: dict
    # {seed: its photos' size, and their flow in pixels and in thousandths of a radian}
    sizes: dict


def main(argv=None):
    parser = table_files.across(__doc__)
    parser.add_argument("--figure", required=True, help="PNG, written")
    args = parser.parse_args(argv)
    scenes = table_files.read(args, "remedies")
    conditions = conditions_of(scenes)
    table = make_table(conditions)
    captures = by_capture(conditions)
    with atomic.replace_file(args.figure) as path:
        if captures:
            sizes_plot.draw(table, captures, path)
        else:
            remedies_plot.draw(conditions, path)
        table_files.write_across(table, to_latex, scenes, args)


def conditions_of(scenes):
    """The `Condition`s of a list of `files.Scored`, in the order of the list.

    Raises ValueError where trainings of one seed differ in their test views.
    """
    conditions, views = {}, {}
    for one in scenes:
        scene = one.scene
        new = Condition(scene.scene, scene.capture, {}, {})
        condition = conditions.setdefault(scene.alike, new)
        remedies = condition.seeds.setdefault(scene.seed, {})
        if scene.share == 1:
            condition.sizes[scene.seed] = size_of(one)
        for row in one.rows:
            psnr_db = row.psnr_db()
            first = views.setdefault((scene.alike, scene.seed), psnr_db.index)
            if not psnr_db.index.equals(first):
                raise ValueError(f"{one.folder}: not the views of the other lengths")
            key = row.method, row.round, row.description
            points = remedies.setdefault(key, {})
            if scene.share in points:
                raise ValueError(f"{scene.scene}: the same as another scene")
            points[scene.share] = row.costs["total_time_s"], psnr_db
    return list(conditions.values())


def size_of(one):
    """Size of a scene's photos, and length of the flow of the plain training's renders.

    flow_px: the median over views of each view's median flow length.
    """
    keys = ("width_px", "height_px", "pixel_angle_mrad")
    path = one.folder / "facts.json"
    facts = json_files.read(path, dict.fromkeys(keys, json_files.NUMBER))
    flow_px = float(one.rows[0].own["flow_px"])
    return {
        "width_px": facts["width_px"],
        "height_px": facts["height_px"],
        "flow_px": flow_px,
        "flow_mrad": flow_px * facts["pixel_angle_mrad"],
    }


def by_capture(conditions):
    """Lists of condition names: a list for each capture with several photo sizes."""
    found = {}
    for one in conditions:
        found.setdefault(one.capture, []).append(one.name)
    return [names for names in found.values() if len(names) > 1]


def make_table(conditions):
    """Lines of all conditions, remedies and budgets."""
    lines = [line for condition in conditions for line in lines_of(condition)]
    return pd.DataFrame(lines, columns=columns.names("remedies"))


def lines_of(condition):
    """Lines of one condition."""
    seeds = condition.seeds
    sizes = list(condition.sizes.values())
    # Seeds share the photos' size; only the flow is averaged.
    flow = {key: np.mean([one[key] for one in sizes]) for key in FLOW}
    size = sizes[0] | flow
    shared = set.intersection(*(set(remedies) for remedies in seeds.values()))
    first = next(iter(seeds.values()))
    remedies = [remedy for remedy in first if remedy in shared]
    plain = remedies[0]
    known = all("oracle" in psnr_db for _, psnr_db in first[plain].values())
    for budget in BUDGETS:
        if not all(budget in of_seed[plain] for of_seed in seeds.values()):
            continue
        times_s = {seed: of_seed[plain][budget][0] for seed, of_seed in seeds.items()}
        for remedy in remedies:
            method, round, parts = remedy
            labels = {
                "condition": condition.name,
                **size,
                "budget": budget,
                "time_s": np.mean(list(times_s.values())),
                "method": method,
                "warping": scores.warping(round),
                "parts": parts,
                "seeds": len(seeds),
            }
            for test_set in TEST_SETS:
                pairs = [
                    [
                        at_time(of_seed[one], times_s[seed], test_set)
                        for one in (remedy, plain)
                    ]
                    for seed, of_seed in seeds.items()
                ]
                if not any(pd.isna(own).all() for own, _ in pairs):
                    found = gain_of(pairs, same_photos=not known)
                    yield labels | {"test_set": test_set} | found


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


def at_time(points, time_s, test_set):
    """PSNR in dB of the views [n] at a time; NaN outside the times of the trainings.

    points: {share: (seconds, PSNR of views by test set)}.
    """
    points = sorted(points.values(), key=lambda point: point[0])
    if any(test_set not in psnr_db for _, psnr_db in points):
        return np.array([np.nan])
    seconds = np.array([point[0] for point in points])
    psnr_db = np.stack([point[1][test_set].to_numpy() for point in points])
    if not seconds[0] / SLACK <= time_s <= seconds[-1] * SLACK:
        return np.full(psnr_db.shape[1], np.nan)
    at = np.log(np.clip(time_s, seconds[0], seconds[-1]))
    return np.array([np.interp(at, np.log(seconds), view) for view in psnr_db.T])


def to_latex(table):
    """LaTeX: a block for each condition, a row for each remedy, budgets as columns."""
    budgets = sorted(set(table["budget"]))
    blocks = []
    for name, of_condition in table.groupby("condition", sort=False):
        chosen = testsets.fairest(set(of_condition["test_set"]))
        lines = of_condition[of_condition["test_set"] == chosen]
        minutes = lines.groupby("budget")["time_s"].first() / 60
        title = ", ".join(f"{minutes[b]:.1f}" for b in budgets if b in minutes)
        title = rf"\emph{{{latex.name(name)}, {chosen}: {title} min}}"
        names = scores.short_names(lines["method"], lines["warping"])
        remedies = lines.assign(remedy=names).groupby("remedy", sort=False)
        rows = [
            [latex.name(remedy), *cells_of(own.set_index("budget"), budgets)]
            for remedy, own in remedies
        ]
        blocks.append([[latex.Span(title, 1 + 2 * len(budgets), "l")], *rows])
    spans = [latex.Span(rf"{budget:g}$\times$", 2) for budget in budgets]
    align = f"l{'rl' * len(budgets)}"
    return latex.table(align, [["Remedy", *spans]], latex.blocks(blocks), NOTES)


def cells_of(own, budgets):
    """Score and gain of one remedy at each budget."""
    cells = []
    for budget in budgets:
        if budget in own.index:
            ends = own.loc[budget, scores.with_ends("gain_")]
            score = f"{own.loc[budget, 'psnr_db']:.2f}"
            cells += [score, latex.difference(*ends)]
        else:
            cells += ["--", ""]
    return cells


if __name__ == "__main__":
    faults.run(main)
