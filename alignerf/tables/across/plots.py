"""The figure of the table across scenes `tradeoff`: what methods cost and bring."""

import matplotlib.figure
import matplotlib.ticker

from alignerf import testsets
from alignerf.tables import scores

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#444444")
# 6 of them and 7 colours: no two of 42 rows look alike.
MARKERS = "osD^vP"
LABEL_PT, SMALL_PT = 9, 7.5
GRID = {"color": "0.92", "linewidth": 0.6}


def panels_of(columns, height, *, rows=1, **shared):
    """(figure, its axes [rows, columns])."""
    width = 1.5 + 3.3 * columns
    figure = matplotlib.figure.Figure((width, height), dpi=200, layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **shared)


def finish(figure, panels, path, ncols=4):
    """Write a figure with the legend of its panels, a name once."""
    shown = {}
    for axes in panels:
        axes.tick_params(labelsize=SMALL_PT)
        axes.grid(**GRID)
        handles, labels = axes.get_legend_handles_labels()
        shown |= dict(zip(labels, handles, strict=True))
    place = {"loc": "outside upper center", "ncols": ncols, "fontsize": SMALL_PT}
    figure.legend(shown.values(), shown, **place)
    figure.savefig(path)


def style_of(place):
    """Colour and marker of a line; the first, the plain training, is black."""
    return {
        "color": COLOURS[(place - 1) % len(COLOURS)] if place else "black",
        "marker": MARKERS[place % len(MARKERS)],
        "markersize": 4,
        "linewidth": 1.2 if place else 2,
    }


def named(table):
    """A table with the column `row`: what a method and its warping are called."""
    names = scores.short_names(table["method"], table["warping"])
    return table.assign(row=[name.replace("_", " ") for name in names])


def costs(table, path):
    """The figure of `tradeoff`: dB over seconds, a panel a condition.

    A line is a method and warping, a point a length of training; the Pareto front is
    dashed.
    """
    table = named(table)
    places = {name: place for place, name in enumerate(dict.fromkeys(table["row"]))}
    conditions = list(table.groupby("condition", sort=False))
    figure, ((*panels,),) = panels_of(len(conditions), 3.8)
    for axes, (condition, lines) in zip(panels, conditions, strict=True):
        front = lines[lines["pareto"]].sort_values("total_time_s")
        # What a budget of seconds buys: nothing more until the next point's seconds.
        look = {"where": "post", "color": "0.6", "linestyle": "--", "linewidth": 0.8}
        axes.step(front["total_time_s"], front["psnr_db"], **look)
        for name, own in lines.groupby("row", sort=False):
            own = own.sort_values("total_time_s")
            look = style_of(places[name])
            axes.plot(own["total_time_s"], own["psnr_db"], label=name, **look)
        axes.set_title(condition.replace("_", " "), fontsize=LABEL_PT)
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
        axes.set_xlabel("seconds in all", fontsize=LABEL_PT)
        test_set = lines["test_set"].iloc[0]
        axes.set_ylabel(f"PSNR {testsets.against(test_set)} (dB)", fontsize=LABEL_PT)
    finish(figure, panels, path, ncols=min(4, 2 * len(panels)))
