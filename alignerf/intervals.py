"""How sure a mean over views is: bootstrap intervals.

Notation: values [n], one number a view; a draw is n views with replacement.
"""

import numpy as np
import scipy.special

LEVEL = 0.95
DRAWS = 10_000


def mean_interval(values, *, draws=DRAWS, seed=0):
    """95 % interval (low, high) of the mean of `values` [n] over views drawn anew.

    For a comparison give the differences view by view: what makes a view hard for
    both is then no part of the interval. The expanded percentile interval
    (Hesterberg, arXiv 1411.5279): plain percentiles of 6 views hold the mean in 88 %
    of cases; here the tails are those with which a normal sample's interval would be
    Student's t. No bootstrap reaches beyond the values: under 5 views it stays too
    narrow. Equal n and seed draw the same views. Under two values, or with one that
    is not finite, there is no interval: (nan, nan).
    """
    values = np.asarray(values, np.float64)
    n = len(values)
    if n < 2 or not np.isfinite(values).all():
        return np.nan, np.nan
    return from_draws(values[resamples(n, draws=draws, seed=seed)].mean(axis=1), n)


def resamples(n, *, draws=DRAWS, seed=0):
    """Indices [draws, n] of views drawn with replacement."""
    return np.random.default_rng(seed).integers(n, size=(draws, n))


def from_draws(statistics, n):
    """Expanded percentile interval (low, high) of a statistic [draws] of n views."""
    student = scipy.special.stdtrit(n - 1, (1 - LEVEL) / 2)
    tail = scipy.special.ndtr(np.sqrt(n / (n - 1)) * student)
    low, high = np.quantile(statistics, [tail, 1 - tail])
    return float(low), float(high)


def pooled_interval(groups, *, draws=DRAWS, seed=0):
    """95 % interval (low, high) of the mean over groups (seeds) of their views' mean.

    groups: one array of values a seed. Seeds are drawn anew, then the views of each,
    so that what differs between trainings is in the interval too; of one seed it is
    `mean_interval`, which cannot know it. Two or three seeds are few draws of what a
    seed does: read the interval as the least that is unsure.
    """
    groups = [np.asarray(values, np.float64) for values in groups]
    if len(groups) == 1:
        return mean_interval(groups[0], draws=draws, seed=seed)
    if min(map(len, groups)) < 2 or not all(np.isfinite(g).all() for g in groups):
        return np.nan, np.nan
    count = len(groups)
    chosen = resamples(count, draws=draws, seed=[seed, count])
    # Each place has draws of its own: a seed drawn twice has its views drawn twice.
    drawn = [
        np.stack(
            [
                values[resamples(len(values), draws=draws, seed=[seed, place, k])].mean(
                    axis=1
                )
                for k, values in enumerate(groups)
            ]
        )[chosen[:, place], np.arange(draws)]
        for place in range(count)
    ]
    return from_draws(np.mean(drawn, axis=0), sum(map(len, groups)))
