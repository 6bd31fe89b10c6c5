"""Figures of the tables across scenes: what methods gain, and what they cost."""

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


def errors_of(rows, prefix):
    """The lengths of intervals below and above a mean of dB."""
    middle, low, high = (rows[name] for name in scores.with_ends(prefix))
    return [(middle - low).clip(lower=0), (high - middle).clip(lower=0)]


def named(table):
    """A table with the column `row`: what a method and its warping are called."""
    names = scores.short_names(table["method"], table["warping"])
    return table.assign(row=[name.replace("_", " ") for name in names])


def costs(table, path):
    """The figure of `tables.across.tradeoff`: dB over seconds, a panel a condition.

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
        axes.set_xlabel("seconds of all that it takes", fontsize=LABEL_PT)
        test_set = lines["test_set"].iloc[0]
        axes.set_ylabel(f"PSNR, {test_set} (dB)", fontsize=LABEL_PT)
    finish(figure, panels, path, ncols=min(4, 2 * len(panels)))


def sizes(table, captures, path):
    """The figure of `tables.across.remedies` of captures at several photo sizes.

    A column a capture: how far photos are off, and what each fix gains, by their
    width. captures: of each, the names of its conditions. Gains are those of the budget
    that most rows have, the largest of several such.
    """
    table = named(table)
    styles = {name: style_of(k) for k, name in enumerate(dict.fromkeys(table["row"]))}
    figure, axes = panels_of(len(captures), 5.4, rows=2, sharex="col")
    for (above, below), conditions in zip(axes.T, captures, strict=True):
        own = table[table["condition"].isin(conditions)]
        own = own.sort_values("width_px", kind="stable")
        draw_flow(above, own)
        title = ", ".join(conditions).replace("_", " ")
        above.set_title(title, fontsize=LABEL_PT)
        draw_gains(below, own, styles)
    finish(figure, axes.flat, path)


def draw_flow(axes, table):
    """Flow in pixels by width, beside what it is for the angle of the smallest size."""
    sizes = table.drop_duplicates("condition")
    width_px, flow_px = sizes["width_px"], sizes["flow_px"]
    axes.plot(width_px, flow_px, color="black", marker="o", markersize=4)
    of_angle = flow_px.iloc[0] * width_px / width_px.iloc[0]
    axes.plot(width_px, of_angle, color="0.6", linestyle="--", linewidth=1)
    for _, size in sizes.iterrows():
        axes.annotate(
            f"{size['flow_mrad']:.2f} mrad",
            (size["width_px"], size["flow_px"]),
            xytext=(4, -10),
            textcoords="offset points",
            fontsize=SMALL_PT,
        )
    axes.set_ylabel("flow (px; dashed: if fixed in angle)", fontsize=LABEL_PT)
    by_width(axes, width_px)


def draw_gains(axes, table, styles):
    """A line a fix, with intervals; the first of `styles` is plain training."""
    budget = budget_of(table)
    # Some of the fixes move cameras.
    test_set = testsets.fairest(set(table["test_set"]), {"cameras"})
    chosen = table[(table["budget"] == budget) & (table["test_set"] == test_set)]
    for name, own in chosen.groupby("row", sort=False):
        errors = None if name == next(iter(styles)) else errors_of(own, "gain_")
        look = {"label": name, "capsize": 2} | styles[name]
        axes.errorbar(own["width_px"], own["gain_db"], errors, **look)
    axes.set_ylabel(
        f"against plain training of the same time\n({test_set}, {budget:g}x, dB)",
        fontsize=LABEL_PT,
    )
    axes.set_xlabel("width of the photos (px)", fontsize=LABEL_PT)
    by_width(axes, chosen["width_px"])


def budget_of(table):
    """The one that most rows have, the largest of several such."""
    return max(table.groupby("budget").size().items(), key=lambda one: one[::-1])[0]


def by_width(axes, width_px):
    """Sizes double: a logarithm, with the widths themselves beside it."""
    axes.set_xscale("log", base=2)
    widths = sorted(set(width_px))
    axes.set_xticks(widths, [f"{width:g}" for width in widths])
    axes.minorticks_off()
