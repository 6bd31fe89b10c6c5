"""When AligNeRF's parts pay: `python -m alignerf.tables.across.regimes`.

The paper's Table 4 is one of its blocks.

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

from alignerf import testsets
from alignerf.files import atomic, csv_files, faults
from alignerf.tables import columns, latex, scores
from alignerf.tables import files as table_files
from alignerf.tables.plots import regimes as regimes_plot

log = logging.getLogger("alignerf")

# How far photos are from the reference's renders, below a scene's folder.
FLOW = "testset/displacement.csv"
TEST_SETS = testsets.shown_in("regimes")
METRICS = ("psnr_db", "ssim")
COSTS = ("train_time_s", "data_time_s", "total_time_s", "rays_seen")
REGIME = ("scene", "perturb_px", "motion_m")
NOTES = (
    "Costs are of all rounds and stages that lead to a row.",
    "PSNR in dB and its difference to the baseline, paired by view; 95 %",
    "intervals over views and, where there are several, seeds; bold: 0 is",
    "outside.",
)


def main(argv=None):
    parser = table_files.across(__doc__)
    parser.add_argument("--figure", required=True, help="PNG, written")
    args = parser.parse_args(argv)
    scenes = table_files.read(args, "regimes")
    table = make_table(scenes)
    with atomic.replace_file(args.figure) as path:
        regimes_plot.draw(table, path)
        table_files.write_across(table, to_latex, scenes, args)


def make_table(scenes):
    """Lines of all regimes, in the order of `scenes` (`files.Scored`)."""
    regimes = {}
    for one in scenes:
        same = regimes.setdefault(one.scene.like, {})
        if (other := same.setdefault(one.scene.seed, one)) is not one:
            raise ValueError(f"{one.scene.scene}: the same as {other.scene.scene}")
    groups = [list(same.values()) for same in regimes.values()]
    lines = [line for group in groups for line in lines_of(group)]
    return pd.DataFrame(lines, columns=columns.names("regimes"))


def lines_of(group):
    """Lines of one regime, a list of scenes that differ in their seed."""
    group = with_shared_rows(group)
    first = group[0].scene
    flow = [median_px(one.folder / FLOW) for one in group]
    labels = {key: getattr(first, key) for key in REGIME} | {
        "steps": first.steps or group[0].rows[0].costs["steps"],
        "seeds": len(group),
        "views": sum(len(one.rows[0].views) for one in group),
        "misalignment_px": np.mean(flow),
    }
    every = [row for one in group for row in one.rows]
    shown = [name for name in TEST_SETS if all(name in r.views for r in every)]
    check_rays(group)
    for place, row in enumerate(group[0].rows):
        named = labels | {"method": row.method, "parts": row.description}
        named["warping"] = row.warping
        for test_set in shown:
            line = named | {"test_set": test_set} | scores_of(group, place, test_set)
            yield line | costs_of(group, place)


def with_shared_rows(group):
    """The scenes with those rows that all have; the log names the others."""
    shared = table_files.shared_rows(group)
    for method, round in dict.fromkeys(name for one in group for name in one.names):
        if (method, round) not in shared:
            name = scores.row_name(method, scores.warping(round))
            first = group[0].scene.scene
            log.warning("%s: not on all seeds, left out: %s", first, name)
    return [
        one._replace(rows=[one.row(name) for name in one.names if name in shared])
        for one in group
    ]


def scores_of(group, place, test_set):
    """Means over seeds and views, and the differences to the baseline and row above."""
    own, base, above = (
        [one.rows[at].views[test_set] for one in group]
        for at in (place, 0, max(place - 1, 0))
    )
    line = {
        key: np.mean([views[key].mean(skipna=False) for views in own])
        for key in METRICS
    }
    for name, other in (("difference", base), ("step", above)):
        pairs = zip(own, other, strict=True)
        differences = [(a["psnr_db"] - b["psnr_db"]).to_numpy() for a, b in pairs]
        line |= scores.pooled_mean_and_interval(differences, f"{name}_")
    return line


def costs_of(group, place):
    """What a method takes, means over seeds, and how large it is."""
    costs = [one.rows[place].costs for one in group]
    means = {key: np.mean([of_scene[key] for of_scene in costs]) for key in COSTS}
    return means | {"params": costs[0]["params"]}


def check_rays(group):
    """Tell of methods without warping that saw more or fewer rays than the baseline."""
    rays = [costs_of(group, place)["rays_seen"] for place in range(len(group[0].rows))]
    for row, seen in zip(group[0].rows, rays, strict=True):
        if row.round == 0 and abs(seen / rays[0] - 1) > 0.01:
            saw = f"{seen / rays[0]:.2f} of the baseline's rays"
            log.warning("%s: %s saw %s", group[0].scene.scene, row.method, saw)


def median_px(path):
    """The scene's misalignment: mean over test views of the flow's median length.

    NaN where one view has none.
    """
    views = csv_files.read(path, columns=["median_px"])
    return views["median_px"].mean(skipna=False)


def to_latex(table):
    """A block per regime, a row per method, test sets side by side."""
    sets = [name for name in TEST_SETS if name in set(table["test_set"])]
    width = 2 * len(sets) + 4
    blocks = []
    for _, rows in table.groupby("scene", sort=False):
        block = [[latex.Span(caption(rows), width, "l")]]
        methods = rows.groupby(["method", "warping"], sort=False)
        for place, (_, own) in enumerate(methods):
            block.append(latex_row(own.set_index("test_set"), sets, is_base=place == 0))
        blocks.append(block)
    spans = [latex.Span(latex.name(name), 2) for name in sets]
    heads = ["Method", *spans, "train (s)", "total (s)", "params (M)"]
    align = f"l{'rl' * len(sets)}rrr"
    return latex.table(align, [heads], latex.blocks(blocks), NOTES)


def caption(rows):
    """What a block of the table is about."""
    row = rows.iloc[0]
    words = [latex.name(row["scene"])]
    if pd.notna(row["motion_m"]):
        words += [f"poses off by {row['perturb_px']:g} px"]
        words += [
            f"motion {100 * row['motion_m']:g} cm" if row["motion_m"] else "still"
        ]
    flow_px = scores.shown(row["misalignment_px"], ".2f")
    words += [f"{row['steps']} steps", f"flow {flow_px} px"]
    return rf"\emph{{{', '.join(words)}; {row['seeds']} seed(s)}}"


def latex_row(own, sets, *, is_base):
    """One method's cells."""
    first = own.iloc[0]
    cells = [latex.name(scores.row_name(first["method"], first["warping"]))]
    for name in sets:
        if name not in own.index:
            cells += ["--", ""]
            continue
        ends = own.loc[name, scores.with_ends("difference_")]
        cells.append(scores.shown(own.loc[name, "psnr_db"], ".2f"))
        cells.append("" if is_base else latex.difference(*ends))
    times = ("train_time_s", "total_time_s")
    cells += [scores.shown(first[key], ".0f") for key in times]
    return [*cells, f"{first['params'] / 1e6:.2f}"]


if __name__ == "__main__":
    faults.run(main)
