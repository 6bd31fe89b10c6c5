"""Splats as tables: `python -m tools.bench.splats RESULTS CASES SUMMARY...`.

RESULTS: folder with NAME of `make judge`. CASES: CSV of name, trainer, capture, faults.
SUMMARY: CSVs of trainings with case, seed, psnr, psnr_aligned, gaussians, train_s and
what there is of SCORES; a case may end in _sN for its seed. Writes splats.csv, and
splat_rows.csv of evidence for `tools.bench.limits`, into --out.
"""

import argparse
import re
from pathlib import Path

import pandas as pd

from alignerf.verdict import evidence
from tools.bench import limits

SCORES = ("ssim", "lpips_alex", "sharpness")
SEED = re.compile(r"(.+)_s\d+")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("cases", type=Path)
    parser.add_argument("summaries", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("."))
    args = parser.parse_args(argv)
    trained(map(pd.read_csv, args.summaries)).to_csv(
        args.out / "splats.csv", index=False
    )
    cases = pd.read_csv(args.cases, comment="#").to_dict("records")
    rows = [judged(args.results, case) for case in cases]
    pd.DataFrame(rows).to_csv(args.out / "splat_rows.csv", index=False)


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
        row |= {key: own[key].mean() for key in SCORES if key in own}
        row["gaussians"] = int(own["gaussians"].mean())
        rows.append(row | {"train_s": own["train_s"].mean()})
    return pd.DataFrame(rows).round(4)


def judged(results, case):
    """A row of `tools.bench.limits` of a judged splat: `case` and its evidence."""
    base = results / case["name"] / "theirs" / "round0"
    overfit = next(base.glob("**/overfit.csv"), None)
    known, _ = evidence.read(results / case["name"], base, overfit=overfit)
    row = {"reading": "renders", "seed": 0, "strengths": 1, "refused": None} | case
    row |= limits.flat(known) | {"depth": known.judged.depth}
    return row | (known.judged.scores or {})


if __name__ == "__main__":
    main()
