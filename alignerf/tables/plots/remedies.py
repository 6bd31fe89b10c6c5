"""The figure of `alignerf.tables.remedies`: dB over seconds, a panel a condition."""

import matplotlib.figure
import matplotlib.ticker
import numpy as np

from alignerf.tables.plots.regimes import COLOURS, LABEL_PT, MARKERS, SMALL_PT


def draw(conditions, path):
    """Write it.

    conditions: {name: {remedy: (seconds, dB, test set)}}, the plain training first,
    whose line is black.
    """
    width = 1.5 + 3.4 * len(conditions)
    figure = matplotlib.figure.Figure((width, 3.8), dpi=200, layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(conditions), squeeze=True))
    for axes, (name, remedies) in zip(panels, conditions.items(), strict=True):
        for place, (remedy, (seconds, psnr_db, _)) in enumerate(remedies.items()):
            axes.plot(
                seconds,
                psnr_db,
                label=remedy.replace("_", " "),
                color=COLOURS[(place - 1) % len(COLOURS)] if place else "black",
                marker=MARKERS[place % len(MARKERS)],
                markersize=4,
                linewidth=1.2 if place else 2,
            )
        (test_set,) = {found[2] for found in remedies.values()}
        axes.set_title(name.replace("_", " "), fontsize=LABEL_PT)
        axes.set_xscale("log", base=2)
        axes.xaxis.set_major_formatter(matplotlib.ticker.FormatStrFormatter("%g"))
        axes.set_xlabel("seconds of all that it takes", fontsize=LABEL_PT)
        axes.set_ylabel(f"PSNR, {test_set} (dB)", fontsize=LABEL_PT)
        axes.tick_params(labelsize=SMALL_PT)
        axes.grid(color="0.92", linewidth=0.6)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(
        handles, labels, loc="outside upper center", ncols=4, fontsize=SMALL_PT
    )
    figure.savefig(path)
