"""What to do with T minutes: `python -m alignerf.tables.across.remedies`.

A remedy is a method that may bring more than plain training: photos warped, cameras put
right or learnt, AligNeRF. Each is trained at several lengths. Its score after any time
is read off the line through these, over the logarithm of the time; all that it takes is
counted but compilation: every training, rendering and flow. So remedies are compared at
equal time.

Writes CSV, LaTeX and a figure. Per condition (scenes that differ in seed and length
only), budget (1, 2 and 4 times the plain training), remedy and test set: the score, and
what it is above plain training of the same time. Differences are paired by view; 95 %
intervals are over views and, where there are several, seeds. A time that a remedy was
not trained for, shorter or longer by more than 5 %, has no score.

Where a capture stands there at several sizes of its photos, the figure shows gains by
size instead: misalignment is fixed in angle, so it grows in pixels (paper, Table 2).
"""

from typing import NamedTuple

import numpy as np
import pandas as pd

from alignerf.experiment.tables import test_sets
from alignerf.files import atomic, faults, json_files
from alignerf.tables import columns, latex, scores
from alignerf.tables import files as table_files
from alignerf.tables.plots import remedies as remedies_plot
from alignerf.tables.plots import sizes as sizes_plot

# The warped test set is another one at each length: its scores do not compare.
TEST_SETS = test_sets.shown_in("remedies")
# Times the plain training's own.
BUDGETS = (1, 2, 4)
# A training's seconds vary from run to run by as much.
SLACK = 1.05
FLOW = ("flow_px", "flow_mrad")
NOTES = (
    "PSNR in dB at equal total time, and its difference to plain training of",
    "the same time, paired by view; 95 % intervals; bold: 0 is outside.",
)


class Condition(NamedTuple):
    """Scenes that differ in seed and length only."""

    name: str
    # Alike for those that differ in their photos' size besides.
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
    """Conditions of `files.Scored`, in their order.

    Raises ValueError where the lengths of a seed have not the same views.
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
    """Of a scene's photos, and how far the plain training's renders are off.

    The flow is the median view's median length.
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
    """Names of conditions that differ in the size of their photos alone, in lists."""
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
    # Seeds differ in their flow alone.
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

    same_photos: seeds are of the trainings alone, so that a view is one view, however
    many seeds there are.
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
    """PSNR in dB of the views [n] after a time; NaN where no training was as long.

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
    """A block per condition, remedies down, budgets across."""
    budgets = sorted(set(table["budget"]))
    blocks = []
    for name, of_condition in table.groupby("condition", sort=False):
        chosen = "oracle" if "oracle" in set(of_condition["test_set"]) else "standard"
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
            ends = own.loc[budget, ["gain_db", "gain_low_db", "gain_high_db"]]
            score = f"{own.loc[budget, 'psnr_db']:.2f}"
            cells += [score, latex.difference(*ends)]
        else:
            cells += ["--", ""]
    return cells


if __name__ == "__main__":
    faults.run(main)
