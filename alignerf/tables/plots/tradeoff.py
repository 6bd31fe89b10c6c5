"""The figure of a sweep: seconds against decibels, and each variant against the base.

Left the means and the Pareto front; their intervals hold how unlike the views are,
which all variants share. Right the paired differences, from which to judge. A variant
has the same number on both sides: its place by PSNR, the best is 1.
"""

import itertools

import matplotlib.figure
import matplotlib.patheffects
import matplotlib.ticker
import numpy as np

# Okabe and Ito's palette, which colour-blind readers tell apart, and two more.
COLOURS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"),
    *("#8C564B", "#7F7F7F", "#999933"),
)
MARKERS = "osD^vP<>X"
TITLES = {
    "log2_entries": "table size",
    "samples": "samples a ray",
    "width": "channels",
    "kind": "kind of field",
    "downscale": "image scale",
    "seed": "seed only",
    "several": "several at once",
}
SMALL_PT = 7.5
LABEL_PT = 9
POINT_PT = 5.5
# A number stands out from the lines that it crosses.
HALO = matplotlib.patheffects.withStroke(linewidth=2, foreground="white")


def draw(table, path):
    """Write the figure of `tables.across.tradeoff`'s table, with a column `kind`."""
    known = table.dropna(subset=["train_time_s", "psnr_db"])
    if known.empty:
        raise ValueError("figure: no variant has a PSNR in every view")
    known = known.sort_values("psnr_db", ascending=False, kind="stable")
    known = known.assign(number=np.arange(1, len(known) + 1))
    kinds = [
        kind for kind in dict.fromkeys(table["kind"]) if kind in set(known["kind"])
    ]
    looks = zip(itertools.cycle(COLOURS), itertools.cycle(MARKERS), strict=False)
    styles = dict(zip(kinds, looks, strict=False))
    height = max(5.0, 2.0 + 0.17 * len(known))
    figure = matplotlib.figure.Figure(
        figsize=(11, height), dpi=200, layout="constrained"
    )
    left, right = figure.subplots(1, 2, width_ratios=[1.6, 1])
    draw_costs(left, known, styles)
    number_points(left, known)
    draw_differences(right, known, styles)
    # Beside the axes: inside, it would hide the costly and poor.
    figure.legend(loc="outside lower center", ncols=5, fontsize=SMALL_PT)
    figure.savefig(path)


def draw_costs(axes, table, styles):
    """Training seconds against PSNR, with intervals and the Pareto front."""
    # What a budget of seconds buys: nothing more until the next point's seconds.
    axes.step(
        *front_of(table).T,
        where="post",
        color="0.35",
        linewidth=1,
        label="Pareto front",
        zorder=1,
    )
    for kind, (colour, marker) in styles.items():
        points = table[table["kind"] == kind]
        x, y = points["train_time_s"], points["psnr_db"]
        low, high = points["psnr_low_db"], points["psnr_high_db"]
        axes.vlines(x, low, high, color=colour, linewidth=0.7, alpha=0.35, zorder=0)
        axes.scatter(
            *(x, y),
            c=colour,
            marker=marker,
            s=POINT_PT**2,
            edgecolors=np.where(points["pareto"], "black", "white"),
            linewidths=np.where(points["pareto"], 1.1, 0.6),
            label=TITLES.get(kind, kind),
            zorder=3,
        )
    axes.set_xscale("log")
    axes.margins(x=0.12)
    label_costs(axes, table["test_set"].iloc[0])


def number_points(axes, table):
    """Each point's number: bold and above to the left on the front, else below.

    There is room: above and to the left of the front lies nothing but another seed.
    """
    for row in table.itertuples():
        side = -1 if row.pareto else 1
        axes.annotate(
            str(row.number),
            (row.train_time_s, row.psnr_db),
            xytext=(0.6 * side * POINT_PT, -0.3 * side * POINT_PT),
            textcoords="offset points",
            horizontalalignment="right" if row.pareto else "left",
            verticalalignment="bottom" if row.pareto else "top",
            fontsize=SMALL_PT,
            fontweight="bold" if row.pareto else "normal",
            path_effects=[HALO],
            zorder=4,
        )


def label_costs(axes, test_set):
    """What the axes show, in which units."""
    axes.xaxis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(matplotlib.ticker.NullFormatter())
    axes.set_xlabel("training time (s, without compilation)", fontsize=LABEL_PT)
    axes.set_ylabel(
        f"PSNR, {test_set} test views (dB, mean and 95 % interval)", fontsize=LABEL_PT
    )
    axes.tick_params(labelsize=LABEL_PT)
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)


def draw_differences(axes, table, styles):
    """Paired differences to the base, the best on top, each with number and name."""
    order = table.iloc[::-1]
    places = np.arange(len(order))
    colours, markers = zip(*(styles[kind] for kind in order["kind"]), strict=True)
    low, high = order["difference_low_db"], order["difference_high_db"]
    axes.axvline(0, color="0.35", linewidth=0.8)
    axes.hlines(places, low, high, color=colours, linewidth=1.2)
    for place, x in zip(places, order["difference_db"], strict=True):
        axes.scatter(x, place, c=colours[place], marker=markers[place], s=26, zorder=3)
    pairs = zip(order["variant"].str.replace("_", " "), order["number"], strict=True)
    axes.set_yticks(places, [f"{name}   {number:2d}" for name, number in pairs])
    for label, on_front in zip(axes.get_yticklabels(), order["pareto"], strict=True):
        label.set_fontweight("bold" if on_front else "normal")
    axes.set_xlabel("difference to base (dB, paired, 95 % interval)", fontsize=LABEL_PT)
    axes.tick_params(labelsize=LABEL_PT)
    axes.tick_params(axis="y", labelsize=SMALL_PT, length=0)
    axes.grid(axis="x", color="0.92", linewidth=0.6)


def front_of(table):
    """(seconds, dB) [n, 2] of the Pareto front, from cheap to dear."""
    front = table[table["pareto"]].sort_values("train_time_s")
    return front[["train_time_s", "psnr_db"]].to_numpy()
