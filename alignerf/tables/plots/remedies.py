"""The figure of `tables.across.remedies`: dB over seconds, a panel a condition."""

import matplotlib.figure
import matplotlib.ticker
import numpy as np

from alignerf.tables import scores
from alignerf.tables.plots.regimes import COLOURS, LABEL_PT, MARKERS, SMALL_PT


def draw(conditions, path):
    """Write it.

    conditions: of `tables.across.remedies`. The plain training's line is black.
    """
    found = {one.name: means_of(one) for one in conditions}
    width = 1.5 + 3.4 * len(conditions)
    figure = matplotlib.figure.Figure((width, 3.8), dpi=200, layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(conditions), squeeze=True))
    for axes, (name, remedies) in zip(panels, found.items(), strict=True):
        for place, (remedy, (seconds, psnr_db, _)) in enumerate(remedies.items()):
            axes.plot(
                seconds,
                psnr_db,
                label=remedy.replace("_", " "),
                **style_of(place),
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


def style_of(place):
    """Colour and marker of a remedy; the plain training, the first, is black."""
    return {
        "color": COLOURS[(place - 1) % len(COLOURS)] if place else "black",
        "marker": MARKERS[place % len(MARKERS)],
    }


def means_of(condition):
    """{remedy's name: (seconds, dB)} of a condition's curves, means over the seeds.

    Against the oracle where it is known, else on the standard test set.
    """
    found, seeds = {}, condition.seeds
    first = next(iter(seeds.values()))
    names = scores.short_names(
        [method for method, _, _ in first],
        [scores.warping(round) for _, round, _ in first],
    )
    for name, (method, round, parts) in zip(names, first, strict=True):
        curves = [of_seed.get((method, round, parts), {}) for of_seed in seeds.values()]
        shares = sorted(set.intersection(*map(set, curves)))
        of_all = [curve[share][1] for curve in curves for share in shares]
        known = all("oracle" in psnr_db for psnr_db in of_all)
        test_set = "oracle" if known else "standard"
        found[name] = (
            [np.mean([curve[share][0] for curve in curves]) for share in shares],
            [
                np.mean([curve[share][1][test_set].mean() for curve in curves])
                for share in shares
            ],
            test_set,
        )
    return found
