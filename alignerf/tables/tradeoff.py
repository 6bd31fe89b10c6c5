"""What settings cost and what they bring: `python -m alignerf.tables.tradeoff`.

Reads the timings and scores of a model and of its variants; writes CSV, LaTeX and a
figure. Scores are means over test views with 95 % intervals over views, and `base`
is the variant that the others are set against, view by view.
"""

import json
import logging

import numpy as np
import pandas as pd

from alignerf.experiment import sweep
from alignerf.experiment.tables import rows as table_rows
from alignerf.files import atomic, faults
from alignerf.tables import files as table_files
from alignerf.tables import intervals, scores
from alignerf.tables.plots import tradeoff as tradeoff_plot

log = logging.getLogger("alignerf")

BASE = "base"
COLUMNS = (
    "variant",
    "changes",
    "pareto",
    "params",
    "steps",
    "rays_seen",
    "train_time_s",
    "compile_time_s",
    "rays_per_s",
    "render_time_s",
    "test_set",
    "psnr_db",
    "psnr_low_db",
    "psnr_high_db",
    "difference_db",
    "difference_low_db",
    "difference_high_db",
    "ssim",
    "standard_psnr_db",
    "device",
)


def main(argv=None):
    parser = table_files.parser(__doc__)
    parser.add_argument("--figure", required=True, help="PNG, written")
    args = parser.parse_args(argv)
    points = table_rows.read(sweep.Point, args.rows)
    table = make_table(points)
    seeds = [p.changes["seed"] for p in points if "seed" in p.changes]
    with atomic.replace_file(args.figure) as path:
        tradeoff_plot.draw(table.assign(kind=kinds_of(points)), path)
        places = table_files.places(args)
        table_files.write(table, to_latex, rows=points, seeds=seeds, **places)
    front = table[table["pareto"]].sort_values("train_time_s")
    log.info("Pareto front: %s", ", ".join(front["variant"]))


def make_table(points):
    """A line per `sweep.Point`; the base is among them."""
    needed = ("psnr_db", "ssim")
    read = {point.variant: scores.read(point.metrics, needed) for point in points}
    if BASE not in read:
        raise ValueError(f"--rows: no variant {BASE!r}")
    base = read[BASE]
    # Where the truth is known, the photos are not what a model should show.
    test_set = "oracle" if "oracle" in base else "standard"
    lines = []
    for point in points:
        score = read[point.variant]
        if not score.index.equals(base.index):
            raise ValueError(f"{point.metrics}: not the views of the base")
        lines.append(
            {"variant": point.variant, "changes": describe(point.changes)}
            | costs_of(point)
            | {"test_set": test_set}
            | scores_of(score, base, test_set)
        )
    table = pd.DataFrame(lines)
    # Another seed shows the spread between runs: it is nothing to choose.
    choices = table["train_time_s"].where(kinds_of(points) != "seed")
    table["pareto"] = pareto_front(choices, table["psnr_db"])
    return table[list(COLUMNS)]


def costs_of(point):
    """What a variant is and takes; rendering in seconds a view."""
    keys = ("params", "steps", "rays_seen", "train_time_s", "compile_time_s", "device")
    training = table_files.read_timing(point.training, *keys)
    rendering = table_files.read_timing(point.rendering, "view_time_s")
    return training | {
        "rays_per_s": training["rays_seen"] / training["train_time_s"],
        "render_time_s": rendering["view_time_s"],
    }


def scores_of(score, base, test_set):
    """Means over views with their intervals; one view without a metric leaves none."""
    psnr_db = score[test_set, "psnr_db"]
    # Of the same views: what makes a view hard for both is no part of the interval.
    difference_db = psnr_db - base[test_set, "psnr_db"]
    low, high = intervals.mean_interval(psnr_db)
    difference_low, difference_high = intervals.mean_interval(difference_db)
    return {
        "psnr_db": psnr_db.mean(skipna=False),
        "psnr_low_db": low,
        "psnr_high_db": high,
        "difference_db": difference_db.mean(skipna=False),
        "difference_low_db": difference_low,
        "difference_high_db": difference_high,
        "ssim": score[test_set, "ssim"].mean(skipna=False),
        "standard_psnr_db": score["standard", "psnr_db"].mean(skipna=False),
    }


def pareto_front(costs, scores):
    """[n] bool: nothing is as cheap and as good, and better in one of the two.

    Equal points are both on the front; one that is not finite never is.
    """
    costs, scores = np.asarray(costs, np.float64), np.asarray(scores, np.float64)
    known = np.isfinite(costs) & np.isfinite(scores)
    no_worse = (costs[:, None] <= costs) & (scores[:, None] >= scores)
    better = (costs[:, None] < costs) | (scores[:, None] > scores)
    return known & ~(no_worse & better & known[:, None]).any(axis=0)


def leaves(changes, prefix=""):
    """(dotted key, value) of every change."""
    for key, value in changes.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


def describe(changes):
    """The changes in words: `field.log2_entries 13, steps 500`."""
    found = ((key, json.dumps(value).strip('"')) for key, value in leaves(changes))
    return ", ".join(f"{key} {value}" for key, value in found)


def kinds_of(points):
    """What each variant turns: one key, a field's kind, or several at once."""
    return np.array([kind_of(point.changes) for point in points])


def kind_of(changes):
    """The one key that a variant turns; `kind`, `several`, or the base."""
    keys = {key.split(".")[-1] for key, _ in leaves(changes)}
    if "kind" in keys:
        return "kind"
    if len(keys) > 1:
        return "several"
    return keys.pop() if keys else BASE


def to_latex(table):
    """booktabs table; what is on the Pareto front is bold. Needs booktabs."""
    wide = pd.DataFrame(
        {
            "Variant": table["variant"].map(scores.latex_name),
            "Changes": table["changes"].map(scores.latex_name),
            "Params (M)": table["params"] / 1e6,
            "Train (s)": table["train_time_s"],
            "Rays (k/s)": table["rays_per_s"] / 1e3,
            "Render (s)": table["render_time_s"],
            r"PSNR (dB) $\uparrow$": [
                scores.with_interval(row.psnr_db, row.psnr_low_db, row.psnr_high_db)
                for row in table.itertuples()
            ],
            r"Difference (dB) $\uparrow$": [
                scores.with_interval(
                    row.difference_db,
                    row.difference_low_db,
                    row.difference_high_db,
                    sign="+",
                )
                for row in table.itertuples()
            ],
            r"SSIM $\uparrow$": table["ssim"],
        }
    )
    style = wide.style.format(precision=2, na_rep="--").hide(axis="index")
    style = style.format("{:.1f}", na_rep="--", subset=["Train (s)", "Rays (k/s)"])
    style = style.format("{:.3f}", na_rep="--", subset=[r"SSIM $\uparrow$"])
    front = pd.IndexSlice[table.index[table["pareto"]], "Variant"]
    style = style.set_properties(subset=front, **{"font-weight": "bold"})
    columns = "lp{45mm}rrrrllr"
    tex = style.to_latex(hrules=True, convert_css=True, column_format=columns)
    return (
        "% \\usepackage{booktabs}\n"
        f"% PSNR and SSIM: {table['test_set'][0]} test set, mean over its views and\n"
        "% 95 % bootstrap interval; differences to the base are paired by view.\n"
        "% Bold: on the Pareto front of training seconds and PSNR. Render: a view.\n"
        f"{tex}"
    )


if __name__ == "__main__":
    faults.run(main)
