"""Curves of quality against training seconds: what `sooner` reads off them and draws.

Notation: a curve is [(seconds, dB), ...], one point for each training of a setting and
seed. Between neighbours dB is linear in log(seconds).
"""

import csv
import itertools
import statistics
from typing import NamedTuple

import matplotlib.figure
import matplotlib.ticker
import numpy as np

from alignerf.command import whole


class Point(NamedTuple):
    """A training: what it was, what it took, and how good its renders are."""

    scene: str
    setting: str
    seed: int
    # How many times the setting's own steps.
    budget: float
    steps: int
    rays_seen: int
    train_time_s: float
    compile_time_s: float
    threads: int
    test_set: str
    psnr_db: float


# Okabe and Ito's palette; what was is dashed.
STYLES = {
    "old": ("#D55E00", "o--"),
    "new": ("#0072B2", "o-"),
    "mlp_old": ("#E69F00", "s--"),
    "mlp_new": ("#009E73", "s-"),
}


def curve_of(points):
    """The curve of these points, whatever their order."""
    return sorted((point.train_time_s, point.psnr_db) for point in points)


def psnr_at(curve, seconds):
    """dB at these seconds; None before the first point and after the last."""
    all_s, all_db = np.transpose(curve)
    if not all_s[0] <= seconds <= all_s[-1]:
        return None
    return float(np.interp(np.log(seconds), np.log(all_s), all_db))


def seconds_to(curve, psnr_db):
    """Seconds at which the curve first reaches these dB; None where it never does.

    A curve that begins above them gives its first point's seconds, an upper bound.
    """
    if begins_above(curve, psnr_db):
        return curve[0][0]
    for (early_s, early_db), (late_s, late_db) in itertools.pairwise(curve):
        if late_db >= psnr_db:
            share = (psnr_db - early_db) / (late_db - early_db)
            return early_s * (late_s / early_s) ** share
    return None


def begins_above(curve, psnr_db):
    """Whether the shortest training is as good already."""
    return curve[0][1] >= psnr_db


def write(path, points):
    """One row for each training."""
    with whole.replace_file(path) as fresh, fresh.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(Point._fields)
        table.writerows(points)


def draw(path, points):
    """One panel for each scene: medians over the seeds, and all that they lie between.

    The bars are the least and the largest dB and seconds; small dots are the seeds.
    """
    scenes = list(dict.fromkeys(point.scene for point in points))
    figure = matplotlib.figure.Figure(
        figsize=(1 + 4.5 * len(scenes), 4), dpi=200, layout="constrained"
    )
    panels = figure.subplots(1, len(scenes), squeeze=False)[0]
    for axes, scene in zip(panels, scenes, strict=True):
        draw_scene(axes, scene, [point for point in points if point.scene == scene])
    with whole.replace_file(path) as fresh:
        figure.savefig(fresh)


def draw_scene(axes, scene, points):
    """The curves of a scene's settings."""
    for setting in dict.fromkeys(point.setting for point in points):
        colour, style = STYLES[setting]
        mine = [point for point in points if point.setting == setting]
        budgets = sorted({point.budget for point in mine})
        seconds, psnr_db = (
            [middle([getattr(p, name) for p in mine if p.budget == b]) for b in budgets]
            for name in ("train_time_s", "psnr_db")
        )
        axes.errorbar(
            *([median for median, _ in found] for found in (seconds, psnr_db)),
            xerr=list(zip(*(reach for _, reach in seconds), strict=True)),
            yerr=list(zip(*(reach for _, reach in psnr_db), strict=True)),
            fmt=style,
            color=colour,
            markersize=5,
            linewidth=1.4,
            elinewidth=0.8,
            capsize=2,
            label=setting.replace("_", ", "),
        )
        axes.scatter(*zip(*curve_of(mine), strict=True), s=6, color=colour, alpha=0.5)
    seeds = len({point.seed for point in points})
    axes.set_title(f"{scene}, {seeds} seed{'s' if seeds > 1 else ''}", fontsize=10)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    axes.set_xlabel("training time (s, without compilation)")
    axes.set_ylabel(f"PSNR, {points[0].test_set} test views (dB)")
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.legend(fontsize=8)


def middle(values):
    """(median, (how far down, how far up the values reach from it))."""
    median = statistics.median(values)
    return median, (median - min(values), max(values) - median)
