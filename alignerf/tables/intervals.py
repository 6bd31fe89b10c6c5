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

    groups: one array of values a seed. The wider, at each end, of two: the bootstrap
    over all views of each seed, which knows how unlike views are, and Student's over
    the seeds' means, which knows how unlike trainings are, if only from two or three
    of them. Of one seed it is `mean_interval`: what another seed does is unknown then.
    """
    groups = [np.asarray(values, np.float64) for values in groups]
    if len(groups) == 1:
        return mean_interval(groups[0], draws=draws, seed=seed)
    if min(map(len, groups)) < 2 or not all(np.isfinite(g).all() for g in groups):
        return np.nan, np.nan
    drawn = [
        values[resamples(len(values), draws=draws, seed=[seed, place])].mean(axis=1)
        for place, values in enumerate(groups)
    ]
    low, high = from_draws(np.mean(drawn, axis=0), sum(map(len, groups)))
    means = np.array([values.mean() for values in groups])
    student = -scipy.special.stdtrit(len(means) - 1, (1 - LEVEL) / 2)
    reach = student * means.std(ddof=1) / np.sqrt(len(means))
    return min(low, means.mean() - reach), max(high, means.mean() + reach)
