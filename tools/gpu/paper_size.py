"""GPU hours of the paper's tables at measured speeds.

    python -m tools.gpu.paper_size measured/trainings.csv [--cards 1 8]

Rays are those of docs/measured/clusters.csv, rays a second the median of a stage's
trainings. Cards train apart: of five trainings eight cards save none beyond the fifth.
"""

import argparse
import math
from pathlib import Path

import pandas as pd

from alignerf.io import faults, provenance

# A stage of trainings.csv, by what clusters.csv calls it.
SYSTEMS = {
    "mip-NeRF 360": "full",
    "AligNeRF (pre-training)": "pretrain",
    "AligNeRF (fine-tuning)": "finetune",
}


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("trainings", type=Path)
    parser.add_argument("--cards", type=int, nargs="+", default=[1, 8])
    args = parser.parse_args(argv)
    # The one whose step is the plain one.
    measured = pd.read_csv(args.trainings).query("method != 'aligned_loss'")
    speeds = measured.groupby("stage")["rays_per_s"].median()
    rows = pd.read_csv(provenance.ROOT / "docs/measured/clusters.csv", comment="#")
    rows = rows[rows["system"].map(SYSTEMS).isin(speeds.index)]
    for row in rows.to_dict("records"):
        rays_per_s, count = speeds[SYSTEMS[row["system"]]], row["trainings"]
        found = [
            f"{hours(1e9 * row['grays'], rays_per_s, count, cards):.1f} h on {cards}"
            for cards in args.cards
        ]
        print(f"Table {row['table']}, {row['system']}:", ", ".join(found))


def hours(rays, rays_per_s, trainings, cards=1):
    """Hours of equal trainings that see so many rays together, one on each card."""
    turns = math.ceil(trainings / cards)
    return turns * rays / trainings / rays_per_s / 3600


if __name__ == "__main__":
    faults.run(main)
