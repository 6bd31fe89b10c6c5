"""Does a test set rank methods as the oracle does: `tables/ranking.csv`.

Kendall's tau-b between the mean PSNR of all methods and rounds on the oracle and on
another test set; writes CSV and LaTeX.
"""

import math

import numpy as np
import pandas as pd
import scipy.stats

from alignerf.tables import intervals, scores

TEST_SETS = ("standard", "warped", "held_out", "control")
# Ranked where all rows have it.
OPTIONAL = "aligned_pose"
COLUMNS = ("test_set", "tau", "tau_low", "tau_high", "rows", "views")
# Each draw ranks all rows for each test set: 0.2 ms a piece.
DRAWS = 1000


def make_table(rows):
    """A line per test set: how it ranks `rows.Scores`.

    Intervals are over views: how the ranking would agree on other views of the scene.
    """
    needed = ["oracle", *TEST_SETS]
    found = [scores.read_psnr(row.metrics, needed, row.aligned_pose) for row in rows]
    if all(OPTIONAL in psnr_db for psnr_db in found):
        needed.append(OPTIONAL)
    for row, psnr_db in zip(rows, found, strict=True):
        if not psnr_db.index.equals(found[0].index):
            raise ValueError(f"{row.metrics}: not the views of the first row")
    oracle, *others = (np.stack([t[name] for t in found]) for name in needed)
    count, views = oracle.shape
    chosen = intervals.resamples(views, draws=DRAWS)
    lines = []
    for name, psnr_db in zip(needed[1:], others, strict=True):
        tau = tau_b(oracle.mean(axis=1), psnr_db.mean(axis=1))
        low = high = np.nan
        if views > 1 and np.isfinite(tau):
            drawn = [
                tau_b(oracle[:, draw].mean(axis=1), psnr_db[:, draw].mean(axis=1))
                for draw in chosen
            ]
            low, high = intervals.from_draws(drawn, views)
        lines.append((name, tau, low, high, count, views))
    return pd.DataFrame(lines, columns=COLUMNS)


def tau_b(first, second):
    """Kendall's tau-b of two scores per row; NaN where there is nothing to rank."""
    if len(first) < 3:
        # scipy divides by zero where two are tied.
        order = np.sign(np.diff(first)) * np.sign(np.diff(second))
        return float(order[0]) if order.any() else math.nan
    # The statistic alone is wanted: the asymptotic p-value costs least.
    return float(scipy.stats.kendalltau(first, second, method="asymptotic").statistic)


def to_latex(table):
    """booktabs table. Needs booktabs."""
    wide = pd.DataFrame(
        {
            "Test set": table["test_set"].map(scores.latex_name),
            r"Kendall's $\tau_b$": [
                scores.with_interval(row.tau, row.tau_low, row.tau_high)
                for row in table.itertuples()
            ],
        }
    )
    tex = wide.style.hide(axis="index").to_latex(hrules=True, column_format="ll")
    return (
        "% \\usepackage{booktabs}\n"
        f"% Ranking of {table['rows'][0]} methods and rounds against the oracle's, by\n"
        f"% their mean PSNR; 95 % bootstrap intervals over {table['views'][0]} views.\n"
        f"{tex}"
    )
