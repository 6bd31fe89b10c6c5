"""Draw the figure made from docs/measured: `python -m tools.docs.figures`.

docs/pictures/budget.png: what each method reaches in a time.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.tables.across import plots, tradeoff


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--root", default=".", type=Path, help="the project's folder")
    docs = parser.parse_args(argv).root / "docs"
    budget = pd.read_csv(docs / "measured/budget.csv", comment="#")
    draw_budget(budget, docs / "pictures/budget.png")


def draw_budget(table, path):
    """A panel a scene, a line a method: dB over seconds."""
    table = table.rename(columns={"scene": "condition", "seconds": "total_time_s"})
    scenes = [own for _, own in table.groupby("condition", sort=False)]
    fronts = [
        tradeoff.pareto_front(own["total_time_s"], own["psnr_db"]) for own in scenes
    ]
    table = pd.concat(scenes).assign(pareto=np.concatenate(fronts), warping="none")
    plots.costs(table, path)


if __name__ == "__main__":
    main()
