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
from pathlib import Path

import pandas as pd

from alignerf import testsets
from alignerf.io import atomic, csv_files, faults
from alignerf.tables import columns, frame, latex, plots, scores

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
    args = faults.arguments(argv, __doc__, frame.OPTIONS | frame.FIGURE)
    views = frame.read_scenes(args, "regimes")
    table = make_table(views, args.results)
    with atomic.replace_file(args.figure) as path:
        plots.regimes(table, path)
        frame.write_across(table, to_latex, views, args)


def make_table(views, results):
    """Lines of all regimes of a `frame.read_scenes`; results: the scenes' folder."""
    lines = []
    for _, group in views.groupby("like", sort=False):
        scenes = group.drop_duplicates("scene")
        for name, again in zip(scenes["scene"], scenes.duplicated("seed"), strict=True):
            if again:
                raise ValueError(f"{name}: the same as {scenes['scene'].iloc[0]}")
        lines += lines_of(group, Path(results))
    return pd.DataFrame(lines, columns=columns.names("regimes"))


def lines_of(group, results):
    """Lines of one regime: of scenes that differ in their seed."""
    every, group = group, frame.shared(group)
    first = group.iloc[0]
    for method, round in every[frame.ROW].drop_duplicates().itertuples(index=False):
        if not ((group["method"] == method) & (group["round"] == round)).any():
            name = scores.row_name(method, scores.warping(round))
            log.warning("%s: not on all seeds, left out: %s", first["scene"], name)
    rows = [own for _, own in group.groupby(frame.ROW, sort=False)]
    flow = [
        csv_files.read(results / scene / FLOW, columns=["median_px"])["median_px"]
        for scene in group["scene"].unique()
    ]
    steps = first["scene_steps"]
    labels = {key: first[key] for key in REGIME} | {
        "steps": first["steps"] if pd.isna(steps) else steps,
        "seeds": len(flow),
        "views": len(group.drop_duplicates(["scene", "view"])),
        # NaN where one view has none.
        "misalignment_px": sum(one.mean(skipna=False) for one in flow) / len(flow),
    }
    shown = set.intersection(*map(frame.known, rows))
    check_rays(rows)
    for own, above in zip(rows, [rows[0], *rows], strict=False):
        own = frame.beside(own, rows[0], "baseline_db")
        own = frame.beside(own, above, "above_db")
        row = own.iloc[0]
        named = labels | {"method": row["method"], "parts": row["description"]}
        named |= {"warping": scores.warping(row["round"]), "params": row["params"]}
        named |= frame.mean_costs(own, COSTS)
        for test_set, lines in frame.sets_of_all(own, TEST_SETS):
            if test_set in shown:
                line = named | {"test_set": test_set} | frame.means(lines, METRICS)
                line |= frame.gains(lines, "baseline_db")
                yield line | frame.gains(lines, "above_db", "step_")


def check_rays(rows):
    """Tell of methods without warping that saw more or fewer rays than the baseline."""
    rays = [frame.mean_costs(own, ["rays_seen"])["rays_seen"] for own in rows]
    for own, seen in zip(rows, rays, strict=True):
        row = own.iloc[0]
        if row["round"] == 0 and abs(seen / rays[0] - 1) > 0.01:
            saw = f"{seen / rays[0]:.2f} of the baseline's rays"
            log.warning("%s: %s saw %s", row["scene"], row["method"], saw)


def to_latex(table):
    """A block per regime, a row per method, test sets side by side."""
    captions = {name: caption(rows) for name, rows in table.groupby("scene")}
    return latex.of_lines(
        table,
        {
            "Regime": table["scene"].map(captions),
            "Method": latex.names(table["method"], table["warping"]),
        },
        [("psnr_db", "PSNR", ".2f"), ("difference_db", "difference", "interval")],
        by="test_set",
        values=[name for name in TEST_SETS if name in set(table["test_set"])],
        fixed=[
            ("train_time_s", "train (s)", ".0f"),
            ("total_time_s", "total (s)", ".0f"),
            ("params", "params (M)", "M"),
        ],
        notes=NOTES,
    )


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
    return f"{', '.join(words)}; {row['seeds']} seed(s)"


if __name__ == "__main__":
    faults.run(main)
