"""Remedies in windows of photos at several sizes, as a table.

    snakemake comparison --cores N --configfile workflow/config/windows.yaml
    python -m tests.bench.full_size workflow/config/windows.yaml --out full_size.csv

Scenes are called CAPTURE, CAPTURE_half and CAPTURE_quarter. A scene or method that was
not scored has no row. `--results` names one folder for each seed.
"""

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from alignerf.files import csv_files, json_files, yaml_files
from alignerf.tables import scores

# Capture: its name, its poses.
CAPTURES = {
    "fox": ("fox", "COLMAP's, given"),
    "chair": ("chair", "the phone's own"),
    "chair_colmap": ("chair", "COLMAP's"),
    "flower": ("flower", "LLFF's"),
    "castle": ("castle_P30", "surveyed"),
}
SIZES = {"": "full", "_half": "half", "_quarter": "quarter"}
# (method, round): its name; the first is what others are compared with.
METHODS = {
    ("mipnerf360", 0): "plain training",
    ("mipnerf360", 1): "warped once",
    ("mipnerf360", 2): "warped twice",
    ("alignerf", 0): "AligNeRF",
    ("aligned", 0): "aligned on the way",
    ("learnt", 0): "cameras learnt with the scene",
}
PLAIN = next(iter(METHODS))
STANDARD, FAIR = "standard", "aligned_pose"
KEYS = ["method", "round", "test_set", "view"]


class Scored(NamedTuple):
    """What one seed of a scene has scored.

    psnr_db: by (method, round, test set, view). time_s: by (method, round), of the
    whole way. flow_px: of plain training, in px of the photo, training views then test.
    """

    psnr_db: pd.Series
    time_s: dict
    flow_px: tuple
    width_px: int
    passes: float


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("config", type=Path)
    parser.add_argument("--results", type=Path, nargs="+", default=[Path("results")])
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)
    scenes = yaml_files.read(args.config)["scenes"]
    rows = []
    for capture in CAPTURES:
        for ending in SIZES:
            scene = capture + ending
            folders = [folder / scene for folder in args.results if scene in scenes]
            seeds = [read(f) for f in folders if (f / "scores.csv").exists()]
            rows += rows_of(capture, ending, seeds)
    pd.DataFrame(rows).to_csv(args.out, index=False, float_format="%.3g")


def read(folder) -> Scored:
    """A scene's scores, times and flow."""
    table = csv_files.read(folder / "scores.csv", columns=(*KEYS, "metric", "value"))
    table = table[table["metric"] == "psnr_db"]
    times = csv_files.read(
        folder / "tables" / "misalignment.csv",
        columns=("method", "warping", "total_time_s"),
    )
    times = times.drop_duplicates(["method", "warping"])
    of_rounds = {name: count for count, name in scores.WARPINGS.items()}
    poses = json_files.read(folder / "poses.json", {"photo_size": list})
    facts = json_files.read(folder / "verdict.json", {"evidence": dict})["evidence"]
    flow = (facts["flow_train_px"], facts["flow_test_px"])
    return Scored(
        psnr_db=table.set_index(KEYS)["value"].astype(float).dropna(),
        time_s={
            (row.method, of_rounds[row.warping]): row.total_time_s
            for row in times.itertuples()
            if row.warping in of_rounds
        },
        flow_px=tuple(np.nan if px is None else px for px in flow),
        width_px=poses["photo_size"][0],
        passes=facts["passes"],
    )


def rows_of(capture, ending, seeds):
    """A row of each method that all seeds have."""
    name, poses = CAPTURES[capture]
    for method, called in METHODS.items():
        if not seeds or not all(method in one.time_s for one in seeds):
            continue
        row = {
            "capture": name,
            "poses": poses,
            "size": SIZES[ending],
            "width_px": seeds[0].width_px,
            "method": called,
            "seeds": len(seeds),
            "test_views": len(views_of(seeds[0], method, STANDARD)),
            "time": np.mean([s.time_s[method] / s.time_s[PLAIN] for s in seeds]),
        }
        for test_set, score, prefix in (
            (STANDARD, "standard_db", "difference_"),
            (FAIR, "aligned_pose_db", "gain_"),
        ):
            own = [views_of(one, method, test_set) for one in seeds]
            row[score] = np.mean([values.mean() for values in own])
            plain = [views_of(one, PLAIN, test_set) for one in seeds]
            if method != PLAIN:
                gains = [(a - b).to_numpy() for a, b in zip(own, plain, strict=True)]
                row |= scores.pooled_mean_and_interval(gains, prefix)
        if method == PLAIN:
            row["flow_train_px"] = np.mean([one.flow_px[0] for one in seeds])
            row["flow_test_px"] = np.mean([one.flow_px[1] for one in seeds])
            row["passes"] = seeds[0].passes
        yield row


def views_of(seed: Scored, method, test_set):
    """PSNR of each held-out photo."""
    return seed.psnr_db.loc[(*method, test_set)]


if __name__ == "__main__":
    main()
