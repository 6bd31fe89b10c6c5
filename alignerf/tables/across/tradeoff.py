"""What settings cost and what they bring: `python -m alignerf.tables.across.tradeoff`.

Of a model and its variants; writes CSV, LaTeX and a figure. Scores are means over test
views with 95 % intervals over views, and `base` is the variant that the others are set
against, view by view.
"""

import json
import logging

import numpy as np
import pandas as pd

from alignerf.files import atomic, faults
from alignerf.tables import columns, latex, results, scores
from alignerf.tables import files as table_files
from alignerf.tables.plots import tradeoff as tradeoff_plot

log = logging.getLogger("alignerf")

BASE = "base"


def main(argv=None):
    parser = table_files.parser(__doc__)
    parser.add_argument("--scene", required=True, help="folder of its results")
    parser.add_argument("--changes", required=True, help="JSON: keys of each variant")
    parser.add_argument("--figure", required=True, help="PNG, written")
    args = parser.parse_args(argv)
    changes = json.loads(args.changes)
    rows = results.read(args.scene, "tradeoff")
    table = make_table(rows, changes)
    seeds = [keys["seed"] for keys in changes.values() if "seed" in keys]
    with atomic.replace_file(args.figure) as path:
        kinds = table["variant"].map(changes).map(kind_of)
        tradeoff_plot.draw(table.assign(kind=kinds), path)
        places = table_files.places(args)
        table_files.write(table, to_latex, rows=rows, seeds=seeds, **places)
    front = table[table["pareto"]].sort_values("train_time_s")
    log.info("Pareto front: %s", ", ".join(front["variant"]))


def make_table(rows, changes):
    """A line per `results.Row`, which is called as its variant.

    changes: {variant: keys and values that differ from the base's}.
    """
    # Where the truth is known, the photos are not what a model should show.
    test_set = "oracle" if "oracle" in rows[0].base else "standard"
    lines = [
        {"variant": row.method, "changes": describe(changes[row.method])}
        | costs_of(row.own)
        | {"test_set": test_set}
        | scores_of(row.views, row.base, test_set)
        for row in rows
    ]
    table = pd.DataFrame(lines)
    # Another seed shows the spread between runs: it is nothing to choose.
    is_seed = [kind_of(changes[row.method]) == "seed" for row in rows]
    choices = table["train_time_s"].mask(is_seed)
    table["pareto"] = pareto_front(choices, table["psnr_db"])
    return table[columns.names("tradeoff")]


def costs_of(own):
    """What a variant is and takes; rendering in seconds a view."""
    keys = ("params", "steps", "rays_seen", "train_time_s", "compile_time_s", "device")
    return {key: own[key] for key in keys} | {
        "rays_per_s": own["rays_seen"] / own["train_time_s"],
        "render_time_s": own["view_time_s"],
    }


def scores_of(score, base, test_set):
    """Means over views with their intervals; one view without a metric leaves none."""
    psnr_db = score[test_set, "psnr_db"]
    # Of the same views: what makes a view hard for both is no part of the interval.
    difference_db = psnr_db - base[test_set, "psnr_db"]
    return {
        **scores.mean_and_interval(psnr_db, "psnr_"),
        **scores.mean_and_interval(difference_db, "difference_"),
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


def kind_of(changes):
    """The one key that a variant turns; `kind`, `several`, or the base."""
    keys = {key.split(".")[-1] for key, _ in leaves(changes)}
    if "kind" in keys:
        return "kind"
    if len(keys) > 1:
        return "several"
    return keys.pop() if keys else BASE


def to_latex(table):
    """A row per variant; what is on the Pareto front is bold."""
    heads = [
        "Variant",
        "Changes",
        "Params (M)",
        "Train (s)",
        "Rays (k/s)",
        "Render (s)",
    ]
    heads += [columns.latex("psnr_db"), r"Difference (dB) $\uparrow$"]
    heads.append(columns.latex("ssim"))
    rows = []
    for line in table.itertuples():
        name = latex.name(line.variant)
        psnr_db = (line.psnr_db, line.psnr_low_db, line.psnr_high_db)
        gain_db = (line.difference_db, line.difference_low_db, line.difference_high_db)
        rows.append(
            [
                rf"\textbf{{{name}}}" if line.pareto else name,
                latex.name(line.changes),
                scores.shown(line.params / 1e6, ".2f"),
                scores.shown(line.train_time_s, ".1f"),
                scores.shown(line.rays_per_s / 1e3, ".1f"),
                scores.shown(line.render_time_s, ".2f"),
                scores.with_interval(*psnr_db),
                scores.with_interval(*gain_db, sign="+"),
                scores.shown(line.ssim, ".3f"),
            ]
        )
    notes = (
        f"PSNR and SSIM: {table['test_set'][0]} test set, mean over its views and",
        "95 % bootstrap interval; differences to the base are paired by view.",
        "Bold: on the Pareto front of training seconds and PSNR. Render: a view.",
    )
    return latex.table("lp{45mm}rrrrllr", [heads], rows, notes)


if __name__ == "__main__":
    faults.run(main)
