"""The figure of `alignerf.tables.remedies` where captures stand there at several sizes.

A column a capture: how far photos are off, and what each remedy gains, by their width.
"""

import matplotlib.figure
import numpy as np

from alignerf.tables import scores
from alignerf.tables.plots.regimes import COLOURS, LABEL_PT, MARKERS, SMALL_PT

# The fair score of moved cameras, where the truth is not known.
PREFERRED = ("oracle", "aligned_pose", "standard")


def draw(table, captures, path):
    """Write it.

    table: of `remedies.make_table`. captures: of each, the names of its conditions.
    Gains are those of the largest budget that all sizes of a capture have.
    """
    figure = matplotlib.figure.Figure(
        figsize=(1.5 + 3.4 * len(captures), 5.4), dpi=200, layout="constrained"
    )
    axes = figure.subplots(2, len(captures), squeeze=False, sharex="col")
    for (above, below), conditions in zip(axes.T, captures, strict=True):
        own = table[table["condition"].isin(conditions)].sort_values("width_px")
        draw_flow(above, own)
        title = ", ".join(conditions).replace("_", " ")
        above.set_title(title, fontsize=LABEL_PT)
        draw_gains(below, own)
    handles, labels = axes[1, 0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=4, fontsize=SMALL_PT
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


def draw_gains(axes, table):
    """A line a remedy, with intervals, at the largest budget that all sizes have."""
    of_sizes = [set(own["budget"]) for _, own in table.groupby("condition")]
    budget = max(set.intersection(*of_sizes))
    test_set = next(one for one in PREFERRED if one in set(table["test_set"]))
    chosen = table[(table["budget"] == budget) & (table["test_set"] == test_set)]
    names = scores.short_names(chosen["method"], chosen["warping"])
    lines = chosen.assign(row=names).groupby("row", sort=False)
    for place, (name, own) in enumerate(lines):
        plain = not own["gain_db"].any()
        ends = own[["gain_low_db", "gain_high_db"]].to_numpy()
        gain_db = own["gain_db"].to_numpy()
        errors = np.abs(ends - gain_db[:, None]).T
        axes.errorbar(
            own["width_px"],
            gain_db,
            None if plain else errors,
            label=name.replace("_", " "),
            color="black" if plain else COLOURS[place % len(COLOURS)],
            marker=MARKERS[place % len(MARKERS)],
            markersize=4,
            linewidth=1.2,
            capsize=2,
        )
    axes.set_ylabel(
        f"against plain training of the same time\n({test_set}, {budget:g}x, dB)",
        fontsize=LABEL_PT,
    )
    axes.set_xlabel("width of the photos (px)", fontsize=LABEL_PT)
    finish(axes, chosen["width_px"])


def finish(axes, width_px):
    """Sizes double: a logarithm, with the widths themselves beside it."""
    axes.set_xscale("log", base=2)
    widths = sorted(set(width_px))
    axes.set_xticks(widths, [f"{width:g}" for width in widths])
    axes.minorticks_off()
    axes.tick_params(labelsize=SMALL_PT)
    axes.grid(color="0.92", linewidth=0.6)
