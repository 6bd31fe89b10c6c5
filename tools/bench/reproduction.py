"""What methods bring beside the paper: CSVs for docs/evidence/reproduction.md.

    python -m tools.bench.reproduction results --budget budget.csv --scenes budget

Of every scene with results/SCENE/comparison, as `snakemake comparison` collects it;
runs not finished are left out. Scenes of one name are pooled over their seeds.

--budget: a row for each scene, length and method. Gains are over plain training of as
many steps, and of as many seconds, where its score is interpolated between its lengths.
"""

import argparse
import re
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.io import faults
from alignerf.tables import frame, scores

TABLE = "comparison"
# Seconds of equal trainings differ by up to this factor from run to run.
SLACK = 1.05
NAME = re.compile(r"(?P<scene>.+?)(_seed(?P<seed>\d+))?(_x(?P<share>[\d.]+))?")
# Test sets of the gains, and the best known truth of a scene first.
TRUTHS = ("oracle", "aligned_pose", "warped")
# Beside PSNR, where they were measured.
OTHERS = ("ssim", "lpips_alex")
PLAIN = ("plain", "mipnerf360", "ngp")
SCENES = {
    "budget": "courtyard, poses off by 1.5 px, objects move",
    "motion": "courtyard, right poses, objects move",
    "still": "courtyard, nothing wrong",
    "choices": "courtyard, validation seed",
    "fox": "fox 270x480",
    "fox_off": "fox 270x480, off by 1.5 px",
    "castle": "castle 384x256",
    "castle_off": "castle 384x256, off by 1.5 px",
    "flower": "flower 504x378",
    "treehill": "treehill 317x208",
    "flower_crop": "flower, a crop at full size",
    "treehill_crop": "treehill, a crop at full size",
}
NAMES = {
    ("plain", 0): "plain training",
    ("mipnerf360", 0): "plain training",
    ("plain", 1): "photos warped once",
    ("mipnerf360", 1): "photos warped once",
    ("patches", 0): "patches, nothing else",
    ("alignerf", 0): "AligNeRF as printed",
    ("aligned_loss", 0): "aligned loss",
    ("adjusted_poses", 0): "cameras adjusted before",
    ("adjusted_loss", 0): "cameras adjusted, aligned loss",
    ("aligned", 0): "cameras aligned in the loop",
}


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("results", type=Path)
    parser.add_argument("--scenes", nargs="+", required=True)
    parser.add_argument("--steps", type=int, default=2000, help="of length 1")
    parser.add_argument("--pixels", type=float, help="of the training photos")
    parser.add_argument("--budget", type=Path, required=True)
    args = parser.parse_args(argv)
    views = read(args.results)
    scenes = [views[views["scene"] == name] for name in args.scenes]
    rows = [row for own in scenes for row in budget_of(own, args)]
    pd.DataFrame(rows).to_csv(args.budget, index=False, float_format="%.4g")


def read(results):
    """Lines of all scenes, a line a view; scene, seed and share are by its name."""
    found = []
    for path in sorted(results.glob(f"*/{TABLE}/trainings.csv")):
        name = NAME.fullmatch(path.parents[1].name)
        labels = {"scene": name["scene"], "seed": int(name["seed"] or 0)}
        labels["share"] = float(name["share"] or 1)
        found.append(frame.read(path.parents[1], TABLE).assign(**labels))
    if not found:
        raise ValueError(f"{results}: no scene has {TABLE}/trainings.csv")
    return pd.concat(found, ignore_index=True)


def psnr_db(views, method, test_set):
    """{seed: PSNR in dB by view} of a (method, round) on a test set."""
    own = views[(views["method"] == method[0]) & (views["round"] == method[1])]
    own = own[own["test_set"] == test_set]
    return {
        seed: one.set_index("view")["psnr_db"].sort_index()
        for seed, one in own.groupby("seed")
    }


def gain(views, one, other, test_set, prefix):
    """Mean gain and its interval, paired by view, of the seeds that both have."""
    ours, theirs = (psnr_db(views, method, test_set) for method in (one, other))
    both = sorted(ours.keys() & theirs.keys())
    gains = [(ours[seed] - theirs[seed]).dropna().to_numpy() for seed in both]
    if not any(len(own) for own in gains):
        return {}, 0
    return scores.pooled_mean_and_interval(gains, prefix), len(both)


def budget_of(views, args):
    """Rows of a scene: each length, each method."""
    truth = next(t for t in TRUTHS if t in set(views["test_set"]))
    plain = next(name for name in PLAIN if name in set(views["method"]))
    base = views[(views["method"] == plain) & (views["round"] == 0)]
    for share, own in views.groupby("share"):
        for method in own[frame.ROW].drop_duplicates().itertuples(index=False):
            mine = own[(own["method"] == method[0]) & (own["round"] == method[1])]
            scene = mine["scene"].iloc[0]
            means = [s.mean() for s in psnr_db(own, method, truth).values()]
            row = {
                "scene": SCENES.get(scene, scene),
                "steps": round(share * args.steps),
                "epochs": epochs_of(mine, args.pixels),
                "method": NAMES.get(tuple(method), method[0]),
                "test_set": truth,
                "seconds": mine.drop_duplicates("seed")["total_time_s"].mean(),
                "psnr_db": np.mean(means),
                "seeds": len(means),
            }
            # By aligned pose there is PSNR alone.
            others = mine[mine["test_set"] == truth.replace("aligned_pose", "warped")]
            row |= {name: others[name].mean() for name in OTHERS if name in others}
            if tuple(method) == ("adjusted_loss", 0):
                over = ("adjusted_poses", 0)
                row |= gain(own, method, over, truth, "over_adjusted_")[0]
            if method != (plain, 0):
                for name, test_set in (("steps", truth), ("warped", "warped")):
                    found, _ = gain(own, method, (plain, 0), test_set, f"{name}_")
                    row |= found
                row |= at_equal_time(mine, base, truth)
            yield row


def epochs_of(mine, pixels):
    """How often a training saw each training pixel; None: their number is not given."""
    return mine["rays_seen"].iloc[0] / pixels if pixels else None


def at_equal_time(mine, base, truth):
    """The gain over plain training of as many seconds, where that is known."""
    gains = []
    for seed, own in mine.groupby("seed"):
        theirs = base[base["seed"] == seed]
        at = at_time(theirs, own["total_time_s"].iloc[0], truth)
        own = own[own["test_set"] == truth].set_index("view")["psnr_db"].sort_index()
        if len(at) == len(own) and not np.isnan(at).any():
            gains.append(own.to_numpy() - at)
    return scores.pooled_mean_and_interval(gains, "seconds_") if gains else {}


def at_time(own, time_s, test_set):
    """PSNR in dB of the views [n] at a time; NaN outside the times of the trainings.

    own: lines of one method and seed, of all its lengths.
    """
    lines = own[own["test_set"] == test_set]
    if lines["share"].nunique() < own["share"].nunique():
        return np.array([np.nan])
    wide = lines.pivot(
        index=["total_time_s", "share"], columns="view", values="psnr_db"
    ).sort_index(level="total_time_s")
    return interpolated(
        wide.index.get_level_values(0).to_numpy(), wide.to_numpy(), time_s
    )


def interpolated(seconds, psnr_db, time_s):
    """dB of the views [n] at a time; psnr_db: [lengths, n] after rising seconds."""
    if not seconds[0] / SLACK <= time_s <= seconds[-1] * SLACK:
        return np.full(psnr_db.shape[1], np.nan)
    at = np.log(np.clip(time_s, seconds[0], seconds[-1]))
    return np.array([np.interp(at, np.log(seconds), view) for view in psnr_db.T])


if __name__ == "__main__":
    faults.run(main)
