"""The figure of `tradeoff` and `remedies`: dB over seconds, a panel a condition."""

import matplotlib.figure
import matplotlib.ticker

from alignerf.tables import scores
from alignerf.tables.plots.regimes import COLOURS, LABEL_PT, MARKERS, SMALL_PT


def draw(table, path):
    """Write it.

    table: of `tables.across.tradeoff`. A line is a method and warping, a point a length
    of training; the first method's line is black, the Pareto front dashed.
    """
    table = table.assign(row=scores.short_names(table["method"], table["warping"]))
    places = {name: place for place, name in enumerate(dict.fromkeys(table["row"]))}
    conditions = list(table.groupby("condition", sort=False))
    figure = matplotlib.figure.Figure(
        (1.5 + 3.4 * len(conditions), 3.8), dpi=200, layout="constrained"
    )
    panels = figure.subplots(1, len(conditions), squeeze=False)[0]
    for axes, (condition, lines) in zip(panels, conditions, strict=True):
        front = lines[lines["pareto"]].sort_values("total_time_s")
        # What a budget of seconds buys: nothing more until the next point's seconds.
        axes.step(
            *(front["total_time_s"], front["psnr_db"]),
            where="post",
            color="0.6",
            linestyle="--",
            linewidth=0.8,
        )
        for name, own in lines.groupby("row", sort=False):
            own = own.sort_values("total_time_s")
            axes.errorbar(
                own["total_time_s"],
                own["psnr_db"],
                label=name.replace("_", " "),
                **style_of(places[name]),
                markersize=4,
                linewidth=1.2 if places[name] else 2,
            )
        axes.set_title(condition.replace("_", " "), fontsize=LABEL_PT)
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
        axes.set_xlabel("seconds of all that it takes", fontsize=LABEL_PT)
        test_set = lines["test_set"].iloc[0]
        axes.set_ylabel(f"PSNR, {test_set} (dB)", fontsize=LABEL_PT)
        axes.tick_params(labelsize=SMALL_PT)
        axes.grid(color="0.92", linewidth=0.6)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=4, fontsize=SMALL_PT
    )
    figure.savefig(path)


def style_of(place):
    """Colour and marker of a line; the first, the plain training, is black."""
    return {
        "color": COLOURS[(place - 1) % len(COLOURS)] if place else "black",
        "marker": MARKERS[place % len(MARKERS)],
    }
