"""Scores of test views as tables show them: paired differences, intervals, names."""

import numpy as np
import pandas as pd

from alignerf.tables import intervals

WARPINGS = {0: "none", 1: "once", 2: "twice", 3: "three times"}


def warping(round):
    """How the paper calls a number of rounds."""
    return WARPINGS.get(round, f"{round} times")


def length(share):
    """How the paper calls a length of training, in lengths of the config's."""
    return f"{share:g}x"


def row_name(method, warping, changed="warped"):
    """What a method and its warping are called in one line; changed: by its rounds."""
    return method if warping == WARPINGS[0] else f"{method}, {changed} {warping}"


def short_names(methods, warpings):
    """The methods' names, with their warpings where a method has rows of several.

    A round may move cameras: it is called warped only where that tells rows apart.
    """
    pairs = list(zip(methods, warpings, strict=True))
    several = {
        one for one, _ in pairs if len({w for method, w in pairs if method == one}) > 1
    }
    return [row_name(*pair) if pair[0] in several else pair[0] for pair in pairs]


def with_ends(prefix=""):
    """Columns of a number of dB and of the ends of its interval."""
    return [f"{prefix}db", f"{prefix}low_db", f"{prefix}high_db"]


def mean_and_interval(values, prefix=""):
    """{column of `with_ends`: dB} of one number a view.

    A view without a number leaves all three empty rather than flatter the mean.
    """
    return pooled_mean_and_interval([np.asarray(values, np.float64)], prefix)


def pooled_mean_and_interval(groups, prefix=""):
    """The same of one array of numbers a seed: the mean over seeds of their means."""
    if not groups or not all(map(len, groups)):
        return dict.fromkeys(with_ends(prefix), np.nan)
    mean = float(np.mean([values.mean() for values in groups]))
    found = (mean, *intervals.pooled_interval(groups))
    return dict(zip(with_ends(prefix), found, strict=True))


def significant(low, high):
    """Whether an interval is one, and does not hold 0."""
    return bool(low > 0 or high < 0)


def with_interval(mean, low, high, *, sign=""):
    """`mean [low, high]` to hundredths; `--` for what is not there."""
    if np.isnan(mean):
        return "--"
    text = f"{mean:{sign}.2f}"
    return text if np.isnan(low) else f"{text} [{low:{sign}.2f}, {high:{sign}.2f}]"


def shown(value, form):
    """A number in this form, `--` where there is none."""
    return "--" if pd.isna(value) else f"{value:{form}}"
