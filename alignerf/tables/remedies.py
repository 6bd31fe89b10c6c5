"""What to do with T minutes: `python -m alignerf.tables.remedies`.

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

from alignerf.experiment.tables import regimes as regime_rows
from alignerf.experiment.tables import rows as table_rows
from alignerf.files import atomic, csv_files, faults, json_files
from alignerf.tables import files as table_files
from alignerf.tables import scores
from alignerf.tables.plots import remedies as remedies_plot
from alignerf.tables.plots import sizes as sizes_plot

# The warped test set is another one at each length: its scores do not compare.
TEST_SETS = ("standard", "aligned_pose", "aligned_pose_gradient", "oracle")
# Times the plain training's own.
BUDGETS = (1, 2, 4)
# A training's seconds vary from run to run by as much.
SLACK = 1.05
FLOW = ("flow_px", "flow_mrad")
COLUMNS = (
    *("condition", "width_px", "height_px", *FLOW),
    *("budget", "time_s", "method", "warping", "parts", "test_set"),
    *("psnr_db", "gain_db", "gain_low_db", "gain_high_db", "seeds", "views"),
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
    parser = table_files.parser(__doc__)
    parser.add_argument("--figure", required=True, help="PNG, written")
    args = parser.parse_args(argv)
    rows = table_rows.read(regime_rows.Remedies, args.rows)
    conditions = conditions_of(rows)
    table = make_table(conditions)
    captures = by_capture(conditions)
    with atomic.replace_file(args.figure) as path:
        if captures:
            sizes_plot.draw(table, captures, path)
        else:
            remedies_plot.draw(conditions, path)
        table_files.write(table, to_latex, rows=rows, **table_files.places(args))


def conditions_of(rows):
    """Conditions of `regimes.Remedies`, in their order.

    Raises ValueError where the lengths of a seed have not the same views.
    """
    found, views = {}, {}
    for row in rows:
        new = Condition(row.scene, row.capture, {}, {})
        condition = found.setdefault(row.alike, new)
        remedies = condition.seeds.setdefault(row.seed, {})
        if row.share == 1:
            condition.sizes[row.seed] = size_of(row)
        for method in row.methods:
            psnr_db = scores.read_psnr(method.metrics, more=method.aligned_pose)
            first = views.setdefault((row.alike, row.seed), psnr_db.index)
            if not psnr_db.index.equals(first):
                raise ValueError(f"{method.metrics}: not the views of the others")
            seconds = table_files.costs_of(method)["total_time_s"]
            key = method.method, method.round, method.parts
            points = remedies.setdefault(key, {})
            if row.share in points:
                raise ValueError(f"{row.scene}: the same as another scene")
            points[row.share] = seconds, psnr_db
    return list(found.values())


def size_of(row):
    """Of a scene's photos, and how far the plain training's renders are off.

    The flow is the median view's median length.
    """
    keys = ("width_px", "height_px", "pixel_angle_mrad")
    facts = json_files.read(row.facts, dict.fromkeys(keys, json_files.NUMBER))
    views = csv_files.read(row.displacement, columns=["median_px"])
    flow_px = float(views["median_px"].median(skipna=False))
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
    return pd.DataFrame(lines, columns=COLUMNS)


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
    """booktabs table: a block per condition, remedies down, budgets across."""
    lines = []
    budgets = sorted(set(table["budget"]))
    for name, of_condition in table.groupby("condition", sort=False):
        chosen = "oracle" if "oracle" in set(of_condition["test_set"]) else "standard"
        rows = of_condition[of_condition["test_set"] == chosen]
        minutes = rows.groupby("budget")["time_s"].first() / 60
        title = ", ".join(f"{minutes[b]:.1f}" for b in budgets if b in minutes)
        lines.append(
            rf"\multicolumn{{{1 + 2 * len(budgets)}}}{{l}}"
            rf"{{\emph{{{scores.latex_name(name)}, {chosen}: {title} min}}}} \\"
        )
        rows = rows.assign(remedy=scores.short_names(rows["method"], rows["warping"]))
        for remedy, own in rows.groupby("remedy", sort=False):
            cells = [scores.latex_name(remedy)]
            by_budget = own.set_index("budget")
            for budget in budgets:
                if budget not in by_budget.index:
                    cells += ["--", ""]
                    continue
                found = by_budget.loc[budget]
                ends = [found[f"gain{end}_db"] for end in ("", "_low", "_high")]
                cells += [f"{found['psnr_db']:.2f}", scores.latex_difference(*ends)]
            lines.append(" & ".join(cells) + r" \\")
        lines.append(r"\midrule")
    heads = " & ".join(rf"\multicolumn{{2}}{{c}}{{{b:g}$\times$}}" for b in budgets)
    return "\n".join(
        [
            "% \\usepackage{booktabs}",
            "% PSNR in dB at equal total time, and its difference to plain training of",
            "% the same time, paired by view; 95 % intervals; bold: 0 is outside.",
            rf"\begin{{tabular}}{{l{'rl' * len(budgets)}}}",
            r"\toprule",
            rf"Remedy & {heads} \\",
            r"\midrule",
            *lines[:-1],
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )


if __name__ == "__main__":
    faults.run(main)
