"""When AligNeRF's parts pay (the paper's Table 4): `python -m alignerf.tables.regimes`.

A regime is what a scene is like and how long it is trained: pose error, motion,
steps. Scenes that differ in their seed only are one regime, and are pooled. Its rows
are the baseline, the staged methods, and trainings on warped photos.

Writes CSV, LaTeX and a figure. Per regime, method and test set: the mean, the
difference to the baseline and that to the row above. Differences are paired by view;
95 % intervals are over views and, where there are several, seeds.
"""

import logging

import numpy as np
import pandas as pd

from alignerf.experiment.tables import regimes as regime_rows
from alignerf.experiment.tables import rows as table_rows
from alignerf.files import atomic, csv_files, faults
from alignerf.tables import files as table_files
from alignerf.tables import scores
from alignerf.tables.plots import regimes as regimes_plot

log = logging.getLogger("alignerf")

TEST_SETS = ("standard", "warped", "control", "held_out", "oracle")
METRICS = ("psnr_db", "ssim")
COSTS = ("train_time_s", "data_time_s", "total_time_s", "rays_seen")
REGIME = ("scene", "perturb_px", "motion_m", "steps")
COLUMNS = (
    *REGIME,
    "seeds",
    "views",
    "misalignment_px",
    "method",
    "warping",
    "parts",
    "test_set",
    *METRICS,
    "difference_db",
    "difference_low_db",
    "difference_high_db",
    "step_db",
    "step_low_db",
    "step_high_db",
    *COSTS,
    "params",
)


def main(argv=None):
    parser = table_files.parser(__doc__)
    parser.add_argument("--figure", required=True, help="PNG, written")
    args = parser.parse_args(argv)
    scenes = table_rows.read(regime_rows.Regime, args.rows)
    table = make_table(scenes)
    with atomic.replace_file(args.figure) as path:
        regimes_plot.draw(table, path)
        table_files.write(table, to_latex, rows=scenes, **table_files.places(args))


def make_table(scenes):
    """Lines of all regimes, in the order of `scenes` (`regimes.Regime`)."""
    regimes = {}
    for scene in scenes:
        same = regimes.setdefault(scene.alike, {})
        if (other := same.setdefault(scene.seed, scene)) is not scene:
            raise ValueError(f"{scene.scene}: the same as {other.scene}")
    groups = [list(same.values()) for same in regimes.values()]
    lines = [line for group in groups for line in lines_of(group)]
    return pd.DataFrame(lines, columns=COLUMNS)


def lines_of(group):
    """Lines of one regime, a list of scenes that differ in their seed."""
    group = with_shared_rows(group)
    read = [
        [scores.read(method.metrics, METRICS) for method in scene.methods]
        for scene in group
    ]
    for scene, of_methods in zip(group, read, strict=True):
        check_views(scene, of_methods)
    labels = {key: getattr(group[0], key) for key in REGIME} | {
        "steps": steps_of(group[0]),
        "seeds": len(group),
        "views": sum(len(of_methods[0]) for of_methods in read),
        "misalignment_px": np.mean([median_px(s.displacement) for s in group]),
    }
    of_all = [views for of_methods in read for views in of_methods]
    test_sets = [name for name in TEST_SETS if all(name in views for views in of_all)]
    methods = group[0].methods
    costs = [costs_of(group, place) for place in range(len(methods))]
    check_rays(group, costs)
    for place, method in enumerate(methods):
        named = labels | {"method": method.method, "parts": method.parts}
        named["warping"] = scores.warping(method.round)
        for test_set in test_sets:
            found = scores_of(read, place, test_set)
            yield named | {"test_set": test_set} | found | costs[place]


def steps_of(scene):
    """Steps of the baseline: those given, or those that its minutes came to."""
    if scene.steps is not None:
        return scene.steps
    return table_files.training_costs(scene.methods[0].trainings)["steps"]


def with_shared_rows(group):
    """The scenes with those rows that all have: `rounds: auto` may end at any round."""
    rows = [[(m.method, m.round) for m in scene.methods] for scene in group]
    shared = set.intersection(*map(set, rows))
    for method, round in dict.fromkeys(row for of_one in rows for row in of_one):
        if (method, round) not in shared:
            name = scores.row_name(method, scores.warping(round))
            log.warning("%s: not on all seeds, left out: %s", group[0].scene, name)
    return [
        scene._replace(
            methods=[m for m in scene.methods if (m.method, m.round) in shared]
        )
        for scene in group
    ]


def check_views(scene, of_methods):
    """All methods of a scene are scored on the same views."""
    for method, views in zip(scene.methods, of_methods, strict=True):
        if not views.index.equals(of_methods[0].index):
            raise ValueError(f"{method.metrics}: not the views of the baseline")


def scores_of(read, place, test_set):
    """Means over seeds and views, and the differences to the baseline and row above."""
    own, base, above = (
        [of_methods[at][test_set, "psnr_db"].to_numpy() for of_methods in read]
        for at in (place, 0, max(place - 1, 0))
    )
    means = {
        key: np.mean([of[place][test_set, key].mean(skipna=False) for of in read])
        for key in METRICS
    }
    found = {}
    for name, other in (("difference", base), ("step", above)):
        differences = [a - b for a, b in zip(own, other, strict=True)]
        found |= scores.pooled_mean_and_interval(differences, f"{name}_")
    return means | found


def costs_of(group, place):
    """What a method takes, means over seeds, and how large it is."""
    costs = [table_files.costs_of(scene.methods[place]) for scene in group]
    means = {key: np.mean([of_scene[key] for of_scene in costs]) for key in COSTS}
    return means | {"params": costs[0]["params"]}


def check_rays(group, costs):
    """Tell of methods without warping that saw more or fewer rays than the baseline."""
    for method, found in zip(group[0].methods, costs, strict=True):
        ratio = found["rays_seen"] / costs[0]["rays_seen"]
        if method.round == 0 and abs(ratio - 1) > 0.01:
            saw = f"{ratio:.2f} of the baseline's rays"
            log.warning("%s: %s saw %s", group[0].scene, method.method, saw)


def median_px(path):
    """The scene's misalignment: mean over test views of the flow's median length.

    NaN where one view has none.
    """
    views = csv_files.read(path, columns=["median_px"])
    return views["median_px"].mean(skipna=False)


def to_latex(table):
    """booktabs table: a block per regime, a row per method, test sets side by side."""
    sets = [name for name in TEST_SETS if name in set(table["test_set"])]
    lines = []
    for _, rows in table.groupby("scene", sort=False):
        lines.append(rf"\multicolumn{{{2 * len(sets) + 4}}}{{l}}{{{caption(rows)}}} \\")
        for place, (_, row) in enumerate(
            rows.groupby(["method", "warping"], sort=False)
        ):
            own = row.set_index("test_set")
            lines.append(latex_row(own, sets, is_base=place == 0))
        lines.append(r"\midrule")
    heads = " & ".join(
        rf"\multicolumn{{2}}{{c}}{{{scores.latex_name(s)}}}" for s in sets
    )
    return "\n".join(
        [
            "% \\usepackage{booktabs}",
            "% Costs are of all rounds and stages that lead to a row.",
            "% PSNR in dB and its difference to the baseline, paired by view; 95 %",
            "% intervals over views and, where there are several, seeds; bold: 0 is",
            "% outside.",
            rf"\begin{{tabular}}{{l{'rl' * len(sets)}rrr}}",
            r"\toprule",
            rf"Method & {heads} & train (s) & total (s) & params (M) \\",
            r"\midrule",
            *lines[:-1],
            r"\bottomrule",
            r"\end{tabular}",
            "",
        ]
    )


def caption(rows):
    """What a block of the table is about."""
    row = rows.iloc[0]
    words = [scores.latex_name(row["scene"])]
    if pd.notna(row["motion_m"]):
        words += [f"poses off by {row['perturb_px']:g} px"]
        words += [
            f"motion {100 * row['motion_m']:g} cm" if row["motion_m"] else "still"
        ]
    flow_px = scores.shown(row["misalignment_px"], ".2f")
    words += [f"{row['steps']} steps", f"flow {flow_px} px"]
    return rf"\emph{{{', '.join(words)}; {row['seeds']} seed(s)}}"


def latex_row(row, sets, *, is_base):
    """One method's line."""
    first = row.iloc[0]
    cells = [scores.latex_name(scores.row_name(first["method"], first["warping"]))]
    for name in sets:
        if name not in row.index:
            cells += ["--", ""]
            continue
        found = row.loc[name]
        ends = ("", "_low", "_high")
        difference = [found[f"difference{end}_db"] for end in ends]
        cells.append(scores.shown(found["psnr_db"], ".2f"))
        cells.append("" if is_base else scores.latex_difference(*difference))
    times = ("train_time_s", "total_time_s")
    cells += [scores.shown(first[key], ".0f") for key in times]
    cells += [f"{first['params'] / 1e6:.2f}"]
    return " & ".join(cells) + r" \\"


if __name__ == "__main__":
    faults.run(main)
