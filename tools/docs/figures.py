"""Draw the figures made from docs/measured: `python -m tools.docs.figures`.

docs/pictures/resolution.png: what misalignment costs by the size of the photos.
docs/pictures/budget.png: what each method reaches in a time.
"""

import argparse
from pathlib import Path

import matplotlib.figure
import numpy as np
import pandas as pd

from alignerf.tables import costs, plots
from alignerf.tables.plots import LABEL_PT, SMALL_PT

PLAIN = "plain training"
# What each remedy is compared with: columns of resolution.csv, label, look of the line.
AGAINST = (
    ("aligned", "as many steps", {"linestyle": "-"}),
    ("twice", "twice the steps", {"linestyle": ":", "markerfacecolor": "none"}),
)


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--root", default=".", type=Path, help="the project's folder")
    docs = parser.parse_args(argv).root / "docs"
    table = read(docs / "measured/resolution.csv")
    draw_resolution(table, docs / "pictures/resolution.png")
    budget = pd.read_csv(docs / "measured/budget.csv", comment="#")
    draw_budget(budget, docs / "pictures/budget.png")


def read(path):
    """resolution.csv, with the width beside the size, from small to large."""
    table = pd.read_csv(path, comment="#")
    table["width_px"] = table["size"].str.split("x").str[0].astype(int)
    return table.sort_values("width_px", kind="stable")


def draw_budget(table, path):
    """A panel a scene, a line a method: dB over seconds."""
    table = table.rename(columns={"scene": "condition", "seconds": "total_time_s"})
    scenes = [own for _, own in table.groupby("condition", sort=False)]
    fronts = [costs.pareto_front(own["total_time_s"], own["psnr_db"]) for own in scenes]
    table = pd.concat(scenes).assign(pareto=np.concatenate(fronts), warping="none")
    plots.costs(table, path)


def draw_resolution(table, path):
    """A column a capture: the flow of its photos, and what remedies bring, by width."""
    captures = table.groupby("capture", sort=False)
    figure = matplotlib.figure.Figure(
        figsize=(1.5 + 3.4 * len(captures), 5.4), dpi=200, layout="constrained"
    )
    axes = figure.subplots(2, len(captures), squeeze=False, sharex="col", sharey="row")
    # All the others are compared with plain training.
    names = [name for name in table["remedy"].unique() if name != PLAIN]
    shown = {}
    for (above, below), (capture, own) in zip(axes.T, captures, strict=True):
        above.set_title(capture, fontsize=LABEL_PT)
        plots.draw_flow(above, own.assign(condition=own["size"]))
        # Room for what stands beside the points.
        for axes_ in (above, below):
            axes_.margins(x=0.28, y=0.12)
        for place, remedy in enumerate(names, start=1):
            draw_gains(below, own[own["remedy"] == remedy], place)
        below.axhline(0, color="black", linewidth=1)
        below.set_xlabel("width of the photos (px)", fontsize=LABEL_PT)
        plots.by_width(below, own["width_px"])
        for axes_ in (above, below):
            axes_.tick_params(labelsize=SMALL_PT)
            axes_.grid(**plots.GRID)
        handles, labels = below.get_legend_handles_labels()
        shown |= dict(zip(labels, handles, strict=True))
    axes[1, 0].set_ylabel("against plain training\n(dB)", fontsize=LABEL_PT)
    figure.legend(
        shown.values(), shown, loc="outside upper center", ncols=2, fontsize=SMALL_PT
    )
    figure.savefig(path)


def draw_gains(axes, own, place):
    """A remedy's lines, one a comparison, with 95 % intervals; left out where empty.

    Each stands a little beside the one before, so that no interval hides another.
    """
    for side, (column, of, look) in enumerate(AGAINST):
        known = own.dropna(subset=f"{column}_gain_db")
        if known.empty:
            continue
        gain_db = known[f"{column}_gain_db"].to_numpy()
        ends = known[[f"{column}_low_gain_db", f"{column}_high_gain_db"]].to_numpy()
        axes.errorbar(
            known["width_px"] * 1.03 ** (2 * place + side - 4),
            gain_db,
            np.abs(ends - gain_db[:, None]).T,
            label=f"{own['remedy'].iloc[0]}, against {of}",
            capsize=2,
            **{**plots.style_of(place), **look},
        )


if __name__ == "__main__":
    main()
