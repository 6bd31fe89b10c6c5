"""Judgements of splats as tables: `python -m tools.bench.splats RESULTS SUMMARY...`.

RESULTS: folder with NAME/verdict.json of `make judge`. SUMMARY: CSVs of trainings with
columns case, seed, psnr, ssim, psnr_aligned, gaussians, train_s; a case may have an
ending _sN for its seed. Writes splats.csv and splat_verdicts.csv into --out.
"""

import argparse
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd

# Numbers of an Evidence that a verdict of renders by another program is told from.
EVIDENCE = (
    *("train_views", "test_views", "photo_px", "photo_width_px", "overfit_px"),
    *("flow_train_px", "flow_test_px", "camera_px", "remainder_px", "moved_fraction"),
    *("psnr_train_db", "psnr_test_db", "detail_median", "blurred_fraction"),
    *("exposure_ev", "shared_ev", "shift_px", "shift_errors"),
    *("distortion_px", "distortion_errors"),
)
MATCHES = ("accepted", "applied", "before_px", "after_px", "pose_error_px", "worst_px")
SEED = re.compile(r"(.+)_s\d+")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("summaries", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("."))
    args = parser.parse_args(argv)
    trained(map(pd.read_csv, args.summaries)).to_csv(
        args.out / "splats.csv", index=False
    )
    rows = [judged(path) for path in sorted(args.results.glob("*/verdict.json"))]
    pd.DataFrame(rows).to_csv(args.out / "splat_verdicts.csv", index=False)


def trained(tables):
    """A row a case: held-out dB over its seeds, mean, least and most."""
    every = pd.concat(tables)
    every["case"] = [
        match[1] if (match := SEED.fullmatch(case)) else case for case in every["case"]
    ]
    rows = []
    for case, own in every.groupby("case", sort=False):
        psnr = own["psnr"].to_numpy()
        row = {"case": case, "seeds": len(own), "held_out": int(own["heldout"].iloc[0])}
        row |= {"psnr_db": psnr.mean()}
        row |= {"psnr_low_db": psnr.min(), "psnr_high_db": psnr.max()}
        row |= {"aligned_pose_db": own["psnr_aligned"].mean()}
        row |= {"ssim": own["ssim"].mean(), "gaussians": int(own["gaussians"].mean())}
        rows.append(row | {"train_s": own["train_s"].mean()})
    return pd.DataFrame(rows).round(4)


def judged(path):
    """A row of a verdict: what it says, and the numbers that it says so by."""
    found = json.loads(path.read_text())
    named = [
        f"{one['cause']} ({one['level']})"
        for one in found["causes"]
        if one["level"] in ("sure", "likely")
    ]
    row = {"case": path.parent.name, "state": found["state"], "named": ", ".join(named)}
    row |= {"first": found["do_first"]["text"]}
    evidence = found["evidence"]
    numbers = {key: evidence[key] for key in EVIDENCE}
    matches = evidence.get("matches") or {}
    numbers |= {f"matches_{key}": matches.get(key, np.nan) for key in MATCHES}
    return row | {
        key: float(f"{value:.4g}") if isinstance(value, float) else value
        for key, value in numbers.items()
    }


if __name__ == "__main__":
    main()
