"""What finer poses bring in trainings: rows of `finer_trainings` as a table.

    python -m tools.bench.finer_trainings CAPTURE_sift CAPTURE_fine ... --out ROWS
    python -m tools.bench.finer_gains ROWS... --out docs/measured/finer_gains.csv

CAPTURE_sift and CAPTURE_fine: crops at the same places of a scene of `source: photos`,
with `refine_keypoints: false` and true. By aligned pose; intervals are over photos.
"""

import argparse
from pathlib import Path

import pandas as pd

from alignerf.tables import intervals

NAMES = {"plain": "plain training", "learnt": "poses optimized with the scene"}


def table_of(rows):
    rows = rows[rows["test_set"] == "aligned_pose"].copy()
    rows[["capture", "poses"]] = rows["scene"].str.rsplit("_", n=1, expand=True)
    keys = ["capture", "method", "seed", "view"]
    wide = rows.pivot_table("psnr_db", keys, "poses", sort=False).dropna()
    wide["gain"] = wide["fine"] - wide["sift"]
    for (capture, method), own in wide.groupby(["capture", "method"], sort=False):
        seeds = [one["gain"].to_numpy() for _, one in own.groupby("seed")]
        # Two seeds give no interval of their own: they stand beside it.
        low, high = intervals.mean_interval(own.groupby("view")["gain"].mean())
        gain = own["gain"].mean()
        shown = f"{gain:+.2f} [{low:+.2f}, {high:+.2f}]"
        yield {
            "capture": capture,
            "training": NAMES[method],
            "colmap_db": round(own["sift"].mean(), 2),
            "finer_db": round(own["fine"].mean(), 2),
            "gain": shown,
            "each_seed_db": " ".join(f"{one.mean():+.2f}" for one in seeds),
            "views": len(seeds[0]),
            "seeds": len(seeds),
        }


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)
    rows = pd.concat([pd.read_csv(path) for path in args.rows])
    pd.DataFrame(table_of(rows)).to_csv(args.out, index=False)


if __name__ == "__main__":
    main()
