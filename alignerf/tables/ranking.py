"""Does a test set rank methods as the oracle does: `tables/ranking.csv`.

Kendall's tau-b between the mean PSNR of all methods and rounds on the oracle and on
another test set.
"""

import math

import numpy as np
import pandas as pd
import scipy.stats

from alignerf import testsets
from alignerf.tables import columns, frame, intervals, latex, scores

TEST_SETS = testsets.shown_in("ranking")
# Ranked where all rows have it.
OPTIONAL = "aligned_pose"
# Each draw ranks all rows for each test set: 0.2 ms a piece.
DRAWS = 1000


def make_table(views):
    """A line per test set: how it ranks the rows of a `frame.read`.

    Intervals are over views: how the ranking would agree on other views of the scene.
    """
    needed = ["oracle", *TEST_SETS]
    psnr_db = [frame.psnr_by_set(own, needed) for _, own in frame.rows_of(views)]
    if all(OPTIONAL in table for table in psnr_db):
        needed.append(OPTIONAL)
    oracle, *others = (np.stack([table[name] for table in psnr_db]) for name in needed)
    lines = [
        (name, *tau_of(oracle, other), *oracle.shape)
        for name, other in zip(needed[1:], others, strict=True)
    ]
    return pd.DataFrame(lines, columns=columns.names("ranking"))


def tau_of(first, second):
    """(tau-b, low, high) of two scores [methods, views]; the interval is over views."""
    count = first.shape[1]
    tau = tau_b(first.mean(axis=1), second.mean(axis=1))
    if count < 2 or not np.isfinite(tau):
        return tau, np.nan, np.nan
    drawn = [
        tau_b(first[:, draw].mean(axis=1), second[:, draw].mean(axis=1))
        for draw in intervals.resamples(count, draws=DRAWS)
    ]
    # A draw in which all methods tie has no rank.
    ranked = [value for value in drawn if np.isfinite(value)]
    return (tau, *intervals.from_draws(ranked, count))


def tau_b(first, second):
    """Kendall's tau-b of two scores per row; NaN where there is nothing to rank."""
    if len(first) < 3:
        # scipy divides by zero where two are tied.
        order = np.sign(np.diff(first)) * np.sign(np.diff(second))
        return float(order[0]) if order.any() else math.nan
    # The statistic alone is wanted: the asymptotic p-value costs least.
    return float(scipy.stats.kendalltau(first, second, method="asymptotic").statistic)


def to_latex(table):
    """A row per test set."""
    notes = (
        f"Ranking of {table['rows'][0]} methods and rounds against the oracle's, by",
        f"their mean PSNR; 95 % bootstrap intervals over {table['views'][0]} views.",
    )
    ends = zip(table["tau"], table["tau_low"], table["tau_high"], strict=True)
    table = table.assign(text=[scores.with_interval(*one) for one in ends])
    rows = {"Test set": list(map(latex.name, table["test_set"]))}
    fixed = [("text", r"Kendall's $\tau_b$", "")]
    return latex.of_lines(table, rows, [], fixed=fixed, notes=notes)
