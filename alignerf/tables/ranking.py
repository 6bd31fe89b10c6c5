"""Does a test set rank methods as the oracle does: `tables/ranking.csv`.

Kendall's tau-b between the mean PSNR of all methods and rounds on the oracle and on
another test set.
"""

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.tables import columns, frame, intervals, latex

TEST_SETS = testsets.shown_in("ranking")
# Ranked where all views of all rows have it.
OPTIONAL = "aligned_pose"
# Each draw ranks all rows for each test set.
DRAWS = 1000


def make_table(views):
    """A line per test set: how it ranks the rows of a `frame.read`.

    Intervals are over views: how the ranking would agree on other views of the scene.
    """
    needed = ["oracle", *TEST_SETS]
    rows = views.groupby(frame.ROW, sort=False)
    psnr_db = [frame.psnr_by_set(own, needed) for _, own in rows]
    if all(OPTIONAL in table and table[OPTIONAL].notna().all() for table in psnr_db):
        needed.append(OPTIONAL)
    oracle, *others = (np.stack([table[name] for table in psnr_db]) for name in needed)
    pairs = zip(needed[1:], (paired(oracle, other) for other in others), strict=True)
    lines = [(name, *tau_of(*pair), *pair[0].shape) for name, pair in pairs]
    return pd.DataFrame(lines, columns=columns.names("ranking"))


def paired(first, second):
    """Two scores [methods, views] of those views that all methods have in both."""
    known = np.isfinite(first + second).all(axis=0)
    return first[:, known], second[:, known]


def tau_of(first, second):
    """(tau-b, low, high) of two scores [methods, views]; the interval is over views."""
    if not (count := first.shape[1]):
        return np.nan, np.nan, np.nan
    tau = float(tau_b(first.mean(axis=1), second.mean(axis=1)))
    if count < 2 or not np.isfinite(tau):
        return tau, np.nan, np.nan
    draws = intervals.resamples(count, draws=DRAWS)
    drawn = tau_b(*(one[:, draws].mean(axis=-1).T for one in (first, second)))
    # A draw in which all methods tie has no rank.
    return (tau, *intervals.from_draws(drawn[np.isfinite(drawn)], count))


def tau_b(first, second):
    """Kendall's tau-b [...] of two scores [..., rows]; NaN where none has an order."""
    one, other = (
        np.sign(scores[..., :, None] - scores[..., None, :])
        for scores in map(np.asarray, (first, second))
    )
    agree, *pairs = (
        (a * b).sum((-2, -1)) for a, b in ((one, other), (one, one), (other, other))
    )
    with np.errstate(invalid="ignore"):
        return agree / np.sqrt(np.multiply(*pairs))


def to_latex(table):
    """A row per test set."""
    notes = (
        f"Ranking of {table['rows'][0]} methods and rounds against the oracle's, by",
        f"their mean PSNR; 95 % bootstrap intervals over {table['views'][0]} views.",
    )
    return latex.of_table("ranking", table, notes=notes)
