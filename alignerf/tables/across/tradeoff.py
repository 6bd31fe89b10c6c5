"""What each method costs and brings: `tradeoff.csv`.

A line has a condition (scenes that differ in seed and length only), a length of
training, and a method after a round; seeds are pooled. Scores are against the oracle
where it is known, else against the photos. Differences are to the reference method's
round 0, trained as long as the config says; 95 % intervals are over views and, where
there are several, seeds. Beside it lies a figure.
"""

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.tables import columns, frame, latex, scores
from alignerf.tables.across import plots

# Cameras that are moved to fit a photo are scored by PSNR alone; other metrics are of
# this test set.
PERCEPTUAL = "warped"


def beside(views, table, args):
    """The figure."""
    return {".png": lambda path: plots.costs(table, path)}


def make_table(views):
    """Lines of a `frame.read_scenes`, from short to long."""
    made = [lines_of(own) for _, own in views.groupby("alike", sort=False)]
    return pd.concat(made)[columns.names("tradeoff")].reset_index(drop=True)


def lines_of(condition):
    """Lines of one condition."""
    lengths = condition["share"].unique()
    whole = condition[condition["share"] == (1 if 1 in lengths else lengths[0])]
    base = frame.of_reference(whole)
    test_set, on = testsets.fairest(frame.known(base)), ["seed", "test_set", "view"]
    views = frame.beside(condition, base, "whole_db", on)
    views = frame.shared(views.sort_values("share", kind="stable"), ["share"])
    known = frame.summary(
        views,
        ["share", *frame.ROW],
        [test_set, PERCEPTUAL],
        against={"psnr_": None, "difference_": "whole_db"},
    )
    known = pd.DataFrame(known).rename(columns={"share": "length", "scenes": "seeds"})
    keys = ["length", *frame.ROW]
    found = known[known["test_set"] == test_set].set_index(keys)
    perceived = known[known["test_set"] == PERCEPTUAL].set_index(keys)
    both = found.index.intersection(perceived.index)
    found.loc[both, columns.NETWORKS] = perceived.loc[both, columns.NETWORKS]
    found = found.reset_index().assign(condition=condition["scene"].iloc[0])
    return found.assign(pareto=pareto_front(found["total_time_s"], found["psnr_db"]))


def pareto_front(seconds, psnr_db):
    """[n] bool: nothing is as cheap and as good, and better in one of the two.

    Equal points are both on the front; one that is not finite never is.
    """
    cost, score = np.asarray(seconds, np.float64), np.asarray(psnr_db, np.float64)
    known = np.isfinite(cost) & np.isfinite(score)
    no_worse = (cost[:, None] <= cost) & (score[:, None] >= score)
    better = (cost[:, None] < cost) | (score[:, None] > score)
    return known & ~(no_worse & better & known[:, None]).any(axis=0)


def to_latex(table):
    """A row per condition, method and length; what is on the Pareto front is bold."""
    names = map(latex.name, scores.short_names(table["method"], table["warping"]))
    pairs = zip(names, table["pareto"], strict=True)
    return latex.of_table(
        "tradeoff",
        table,
        written={
            "length": list(map(scores.length, table["length"])),
            "method": [rf"\textbf{{{n}}}" if front else n for n, front in pairs],
        },
    )
