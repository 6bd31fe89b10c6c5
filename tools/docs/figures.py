"""Draw the figures made from docs/measured: `python -m tools.docs.figures`.

docs/pictures/budget.png: what each method reaches in a time. dose.png: what each gains
over plain training by how far photos are off.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.tables import costs, plots

# Percent of the width by which the scenes of dose.yaml are off. COLMAP's is what its
# pose error is without motion, the mean of three seeds.
DOSES = {"right": 0.0, "off_0_12": 0.06, "off_0_2": 0.1, "off_0_6": 0.3}
ROTATED, MOVED, COLMAP = 0.75, "moved_1_5", ("by_colmap", 0.18)
# Median flow of held-out photos over the width, docs/measured/resolution.csv.
CAPTURES = {"flower": 0.063, "fox": 0.080}
SHOWN = ("photos warped once", "aligned loss", "cameras adjusted before")


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--root", default=".", type=Path, help="the project's folder")
    docs = parser.parse_args(argv).root / "docs"
    budget = pd.read_csv(docs / "measured/budget.csv", comment="#")
    draw_budget(budget, docs / "pictures/budget.png")
    dose = pd.read_csv(docs / "measured/dose.csv", comment="#")
    full = budget[budget["steps"] == dose["steps"].iloc[0]]
    draw_dose(dose, full, docs / "pictures/dose.png")


def draw_budget(table, path):
    """A panel a scene, a line a method: dB over seconds."""
    table = table.rename(columns={"scene": "condition", "seconds": "total_time_s"})
    scenes = [own for _, own in table.groupby("condition", sort=False)]
    fronts = [costs.pareto_front(own["total_time_s"], own["psnr_db"]) for own in scenes]
    table = pd.concat(scenes).assign(pareto=np.concatenate(fronts), warping="none")
    plots.costs(table, path)


def draw_dose(dose, full, path):
    """A line a method: gains by rotation; hollow by translation, a cross COLMAP's."""
    full = full.assign(scene="full")
    places = DOSES | {"full": ROTATED, MOVED: ROTATED, COLMAP[0]: COLMAP[1]}
    table = pd.concat([dose, full])
    figure, ((axes,),) = plots.panels_of(1, 3.6)
    axes.axhline(0, color="0.35", linewidth=0.8)
    for name, percent in CAPTURES.items():
        axes.axvline(percent, color="0.7", linewidth=0.8, linestyle=":")
        axes.annotate(name, (percent, 0.02), fontsize=6, rotation=90, color="0.4")
    for place, name in enumerate(SHOWN):
        own = table[table["method"] == name].set_index("scene")
        look = plots.style_of(place + 1)
        for scenes, more in (
            ([*DOSES, "full"], {"label": name}),
            ([MOVED], {"linestyle": "none", "markerfacecolor": "none"}),
            ([COLMAP[0]], {"linestyle": "none", "marker": "x"}),
        ):
            rows = own.loc[scenes]
            at = [places[scene] + 0.006 * place for scene in scenes]
            errors = plots.errors_of(rows, "steps_")
            axes.errorbar(at, rows["steps_db"], errors, capsize=2, **(look | more))
    axes.set_xlabel("cameras off by, % of the width", fontsize=plots.LABEL_PT)
    axes.set_ylabel("over plain training, ground truth (dB)", fontsize=plots.LABEL_PT)
    plots.finish(figure, [axes], path)


if __name__ == "__main__":
    main()
