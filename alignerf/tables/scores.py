"""Scores of test views as tables show them: paired differences, intervals, names.

Notation: `psnr_db` is a table of one row a view and one column a test set.
"""

import numpy as np
import pandas as pd

from alignerf.files import csv_files
from alignerf.tables import intervals

WARPINGS = {0: "none", 1: "once", 2: "twice", 3: "three times"}


def warping(round):
    """How the paper calls a number of rounds."""
    return WARPINGS.get(round, f"{round} times")


def row_name(method, warping):
    """What a method and its warping are called in one line."""
    return method if warping == WARPINGS[0] else f"{method}, warped {warping}"


def short_names(methods, warpings):
    """The methods' names, with their warpings where a method has rows of several.

    A round may move cameras: it is called warped only where that tells rows apart.
    """
    pairs = list(zip(methods, warpings, strict=True))
    several = {
        one for one, _ in pairs if len({w for method, w in pairs if method == one}) > 1
    }
    return [row_name(*pair) if pair[0] in several else pair[0] for pair in pairs]


def read(path, metrics=("psnr_db",), more=None):
    """(test set, metric) columns, a row per test view, all of `metrics` among them.

    more: another file, of further test sets of the same views. Raises ValueError naming
    the file where it lacks a metric, or any view.
    """
    if more is not None:
        first, second = read(path, metrics), read(more, metrics)
        if not first.index.equals(second.index):
            raise ValueError(f"{more}: not the views of {path}")
        return pd.concat([first, second], axis=1)
    try:
        scores = csv_files.read(path, columns=("view", "test_set"))
        scores = scores.pivot(index="view", columns="test_set")
    except ValueError as error:
        raise ValueError(f"{path}: not the scores of views: {error}") from None
    if scores.empty:
        raise ValueError(f"{path}: not the scores of views: there is none")
    if missing := set(metrics) - set(scores.columns.get_level_values(0)):
        raise ValueError(f"{path}: no column {min(missing)}")
    return scores.swaplevel(axis=1)


def read_psnr(path, needed=(), more=None):
    """PSNR in dB, a row per view and a column per test set, `needed` among them.

    more: as in `read`.
    """
    psnr_db = read(path, more=more).xs("psnr_db", axis=1, level=1)
    for name in needed:
        if name not in psnr_db:
            raise ValueError(f"{path}: no test set {name!r}")
    return psnr_db


def mean_and_interval(values, prefix=""):
    """{`prefix`db, `prefix`low_db, `prefix`high_db} of one number a view.

    A view without a number leaves all three empty rather than flatter the mean.
    """
    return pooled_mean_and_interval([np.asarray(values, np.float64)], prefix)


def pooled_mean_and_interval(groups, prefix=""):
    """The same of one array of numbers a seed: the mean over seeds of their means."""
    mean = float(np.mean([values.mean() for values in groups]))
    keys = (f"{prefix}db", f"{prefix}low_db", f"{prefix}high_db")
    return dict(zip(keys, (mean, *intervals.pooled_interval(groups)), strict=True))


def significant(low, high):
    """Whether an interval is one, and does not hold 0."""
    return bool(low > 0 or high < 0)


def with_interval(mean, low, high, *, sign=""):
    """`mean [low, high]` to hundredths; `--` for what is not there."""
    if np.isnan(mean):
        return "--"
    text = f"{mean:{sign}.2f}"
    return text if np.isnan(low) else f"{text} [{low:{sign}.2f}, {high:{sign}.2f}]"


def latex_difference(mean, low, high):
    """A difference and, small, its interval; bold where that does not hold 0."""
    if np.isnan(mean):
        return "--"
    text = f"{mean:+.2f}"
    if significant(low, high):
        text = rf"\textbf{{{text}}}"
    return text if np.isnan(low) else rf"{text} {{\tiny [{low:+.2f}, {high:+.2f}]}}"


def shown(value, form):
    """A number in this form, `--` where there is none."""
    return "--" if pd.isna(value) else f"{value:{form}}"


def latex_name(name):
    """A name as LaTeX takes it."""
    return name.replace("_", r"\_")
