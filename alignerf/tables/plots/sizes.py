"""The figure of `tables.across.remedies` where captures stand there at several sizes.

A column a capture: how far photos are off, and what each remedy gains, by their width.
"""

import matplotlib.figure
import numpy as np

from alignerf import testsets
from alignerf.tables import scores
from alignerf.tables.plots import remedies
from alignerf.tables.plots.regimes import LABEL_PT, SMALL_PT


def draw(table, captures, path):
    """Write it.

    table: of `remedies.make_table`. captures: of each, the names of its conditions.
    Gains are those of the budget that most rows have, the largest of several such.
    """
    names = dict.fromkeys(scores.short_names(table["method"], table["warping"]))
    styles = {name: remedies.style_of(place) for place, name in enumerate(names)}
    figure = matplotlib.figure.Figure(
        figsize=(1.5 + 3.4 * len(captures), 5.4), dpi=200, layout="constrained"
    )
    axes = figure.subplots(2, len(captures), squeeze=False, sharex="col")
    for (above, below), conditions in zip(axes.T, captures, strict=True):
        own = table[table["condition"].isin(conditions)]
        own = own.sort_values("width_px", kind="stable")
        draw_flow(above, own)
        title = ", ".join(conditions).replace("_", " ")
        above.set_title(title, fontsize=LABEL_PT)
        draw_gains(below, own, styles)
    shown = {}
    for below in axes[1]:
        handles, labels = below.get_legend_handles_labels()
        shown |= dict(zip(labels, handles, strict=True))
    figure.legend(
        shown.values(),
        shown,
        loc="outside upper center",
        ncols=4,
        fontsize=SMALL_PT,
    )
    figure.savefig(path)


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
    finish(axes, width_px)


def draw_gains(axes, table, styles):
    """A line a remedy, with intervals; the first of `styles` is plain training."""
    budget = budget_of(table)
    # Some of the remedies move cameras.
    test_set = testsets.fairest(set(table["test_set"]), {"cameras"})
    chosen = table[(table["budget"] == budget) & (table["test_set"] == test_set)]
    names = scores.short_names(chosen["method"], chosen["warping"])
    for name, own in chosen.assign(row=names).groupby("row", sort=False):
        gain_db = own["gain_db"].to_numpy()
        ends = own[["gain_low_db", "gain_high_db"]].to_numpy()
        plain = name == next(iter(styles))
        axes.errorbar(
            own["width_px"],
            gain_db,
            None if plain else np.abs(ends - gain_db[:, None]).T,
            label=name.replace("_", " "),
            markersize=4,
            linewidth=1.2,
            capsize=2,
            **styles[name],
        )
    axes.set_ylabel(
        f"against plain training of the same time\n({test_set}, {budget:g}x, dB)",
        fontsize=LABEL_PT,
    )
    axes.set_xlabel("width of the photos (px)", fontsize=LABEL_PT)
    finish(axes, chosen["width_px"])


def budget_of(table):
    """The one that most rows have, the largest of several such."""
    return max(table.groupby("budget").size().items(), key=lambda one: one[::-1])[0]


def finish(axes, width_px):
    """Sizes double: a logarithm, with the widths themselves beside it."""
    axes.set_xscale("log", base=2)
    widths = sorted(set(width_px))
    axes.set_xticks(widths, [f"{width:g}" for width in widths])
    axes.minorticks_off()
    axes.tick_params(labelsize=SMALL_PT)
    axes.grid(color="0.92", linewidth=0.6)
