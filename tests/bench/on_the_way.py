"""Alignment on the way against plain training, on prepared scenes.

    python -m tests.bench.on_the_way --out rows.csv --lengths 0.5 1 2
        --config workflow/config/remedies.yaml --scenes results/both_wrong ...
    python -m tests.bench.on_the_way --out rows.csv --table on_the_way.csv

The first trains methods of the config on each scene, two at a time with one thread
each, and adds a line to the CSV for each test view; what is there is not trained again.
The second makes the table of it: gains at as many steps, and at equal time.
"""

import argparse
import concurrent.futures
import csv
import json
import multiprocessing
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from alignerf.experiment import check, plan
from alignerf.files import images, yaml_files
from alignerf.tables import intervals
from alignerf.tables.across import remedies

COLUMNS = ("scene", "seed", "share", "method", "view", "oracle_db", "standard_db")
COLUMNS += ("fair_db", "fitted_db", "detail")
COLUMNS += ("train_s", "align_s", "given_px", "after_px")
# Of a fair score, in the stage that makes it.
SQUARES, MARGIN = 4, 0.25
# Times the plain training's steps.
BUDGETS = (1, 2, 4)


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--config", type=Path)
    parser.add_argument("--scenes", nargs="+", default=[])
    parser.add_argument("--methods", nargs="+", default=["plain", "aligned"])
    parser.add_argument("--lengths", nargs="+", type=float, default=[1.0])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--table", type=Path)
    args = parser.parse_args(argv)
    if args.table:
        table_of(pd.read_csv(args.out)).to_csv(
            args.table, index=False, float_format="%.4g"
        )
        return
    done = set()
    if args.out.exists():
        there = pd.read_csv(args.out)
        done = {tuple(key) for key in there[list(COLUMNS[:4])].drop_duplicates().values}
    todo = [
        (scene, share, method)
        for share in args.lengths
        for scene in args.scenes
        for method in args.methods
        if (name_of(scene), seed_of(scene), share, method) not in done
    ]
    if not args.out.exists():
        args.out.write_text(",".join(COLUMNS) + "\n")
    # Each training is a process of its own, as in the workflow.
    spawn = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(
        args.jobs, mp_context=spawn, max_tasks_per_child=1
    ) as pool:
        work = {pool.submit(measure, args.config, *one): one for one in todo}
        for found in concurrent.futures.as_completed(work):
            with open(args.out, "a", newline="") as file:
                csv.DictWriter(file, COLUMNS).writerows(found.result())
            print(*work[found], found.result()[0], flush=True)


def name_of(scene):
    return re.sub(r"_seed\d+$", "", Path(scene).name)


def seed_of(scene):
    found = re.search(r"_seed(\d+)$", Path(scene).name)
    return int(found[1]) if found else 0


def job_of(config, scene, share, method):
    """The job of a method of a config on a scene, `share` times as long."""
    read = yaml_files.read(config)
    steps = round(share * read["training"]["steps"])
    kept = {"scenes": {"scene": {"source": "courtyard"}}, "seed": seed_of(scene)}
    kept |= {"models": read.get("models", {"base": {}}), "training": {"steps": steps}}
    plain = {"plain": read["methods"]["plain"]}
    kept["methods"] = plain | {method: read["methods"][method]}
    experiment = plan.Experiment(check.checked(kept), None)
    return experiment.at("scene", method, 0).job


def measure(config, scene, share, method):
    """Train, and a row for each test view."""
    from alignerf.scenes import prepared
    from alignerf.training import renderer

    scene, job = Path(scene), job_of(config, scene, share, method)
    truth = scene / "truth"
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        command = [sys.executable, "-m", "alignerf.train", "--config", job]
        command += ["--scene", str(scene), "--checkpoints", str(out / "checkpoints")]
        command += ["--model", str(out / "model"), "--timing", str(out / "timing")]
        command += ["--learnt", str(out / "learnt"), "--threads", "1"]
        command += ["--truth", str(truth)] if truth.is_dir() else []
        subprocess.run(command, check=True, capture_output=True)
        timing = json.loads((out / "timing").read_text())
        loaded = prepared.load(scene, out / "learnt" / "cameras.npz")
        model, params = renderer.read_model(job, out / "model", loaded)
        render = renderer.make_renderer(model, params, loaded.width, loaded.height)
    error = timing.get("pose_error_px", {})
    aligned = timing.get("alignments", [])
    shared = {
        "scene": name_of(scene),
        "seed": seed_of(scene),
        "share": share,
        "method": method,
        "train_s": timing["train_time_s"],
        "align_s": round(sum(row["time_s"] for row in aligned), 3),
        "given_px": error.get("given"),
        "after_px": error.get("after"),
    }
    return [
        shared | scores(loaded, render, view, truth) for view in loaded.views("test")
    ]


def scores(loaded, render, view, truth):
    """PSNR of a test view, by the oracle where there is one, else the fair one.

    fitted_db: against the oracle too, by the camera that fits it best. Cameras that
    agree with each other may have bent the frame a little, which no photo shows.
    """
    name = loaded.names[view]
    image, depth = render(loaded.pixtocams[view], loaded.camtoworlds[view])
    photo = images.read(loaded.folder / "images" / f"{name}.png")
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(np.float32)
    found = {"view": name, "standard_db": psnr_db(image, photo)}
    found["detail"] = float(cv2.Laplacian(grey, cv2.CV_32F).var())
    if (truth / "oracle").is_dir():
        oracle = images.read(truth / "oracle" / f"{name}.png")
        fitted = fair_image(loaded, render, view, image, depth, oracle)
        found["fitted_db"] = psnr_db(fitted, oracle)
        return found | {"oracle_db": psnr_db(image, oracle)}
    fair = fair_image(loaded, render, view, image, depth, photo)
    return found | {"fair_db": psnr_db(fair, photo)}


def fair_image(loaded, render, view, image, depth, photo):
    """The view by cameras moved to fit its photo, as `alignerf.align_test_poses`."""
    from scipy import ndimage

    from flow.camera import fit as camera_fit
    from flow.camera import motion as camera_motion
    from flow.estimation import pairs
    from flow.warping import controls

    block_px = max(1, min(photo.shape[:2]) // SQUARES)
    half = controls.checkerboard(*photo.shape[:2], block_px=block_px)
    flow_px, valid, _ = pairs.flow_and_validity(image, photo)
    camera = loaded.pixtocams[view], loaded.camtoworlds[view]
    found = np.zeros_like(image)
    for mask in (half, ~half):
        inner = ndimage.binary_erosion(
            ~mask, iterations=int(MARGIN * block_px), border_value=1
        )
        fit = camera_fit.split(flow_px, valid & inner, camera[0], depth, log_focal=0.0)
        _, pose = camera_motion.apply(fit.motion, *camera)
        found[mask] = render(camera[0], pose, mask)[0][mask]
    return found


def psnr_db(image, other):
    error = (image.astype(np.float64) - other) / 255
    return float(-10 * np.log10(np.mean(error**2)))


def table_of(rows):
    """A line for each scene, length and method; gains are over plain training."""
    lines = []
    for scene, own in rows.groupby("scene", sort=False):
        score = "oracle_db" if own["oracle_db"].notna().all() else "fair_db"
        for (share, method), chosen in own.groupby(["share", "method"], sort=False):
            plain = own[(own["share"] == share) & (own["method"] == "plain")]
            line = {"scene": scene, "share": share, "method": method}
            line |= {"test_set": score.removesuffix("_db"), "seeds": 0}
            of_seed = dict(iter(chosen.groupby("seed")))
            line["seeds"] = len(of_seed)
            for key in ("train_s", "align_s", "given_px", "after_px"):
                line[key] = np.median([one[key].iloc[0] for one in of_seed.values()])
            for key in (score, "standard_db", "detail"):
                means = [one[key].mean() for one in of_seed.values()]
                line[key.replace(score, "psnr_db")] = np.mean(means)
            gains, ratios, at_equal, fitted = [], [], [], []
            for seed, one in of_seed.items():
                other = plain[plain["seed"] == seed]
                if other.empty:
                    continue
                gains.append(one[score].to_numpy() - other[score].to_numpy())
                fitted.append(
                    one["fitted_db"].to_numpy() - other["fitted_db"].to_numpy()
                )
                ratios.append(one["train_s"].iloc[0] / other["train_s"].iloc[0])
                at_equal.append(at_equal_time(own, seed, share, method, score))
            if gains and method != "plain":
                line["gain_db"] = np.mean([gain.mean() for gain in gains])
                line["gain_low_db"], line["gain_high_db"] = interval(gains, score)
                line["fitted_db"] = np.mean([gain.mean() for gain in fitted])
                ends = interval(fitted, score)
                line["fitted_low_db"], line["fitted_high_db"] = ends
                line["time_ratio"] = np.median(ratios)
                line["median_gain_db"] = np.median([gain.mean() for gain in gains])
                equal = [gain for gain in at_equal if gain is not None]
                if len(equal) == len(gains):
                    line["equal_db"] = np.mean([gain.mean() for gain in equal])
                    ends = interval(equal, score)
                    line["equal_low_db"], line["equal_high_db"] = ends
            lines.append(line)
    return pd.DataFrame(lines)


def interval(gains, score):
    """Over views and seeds; seeds of one capture are of the trainings alone."""
    if score == "fair_db":
        return intervals.mean_interval(np.mean(gains, axis=0))
    return intervals.pooled_interval(gains)


def at_equal_time(rows, seed, share, method, score):
    """What a method's views gain at the seconds of plain training; None if unknown."""
    own = rows[rows["seed"] == seed]

    def points(name):
        chosen = own[own["method"] == name].groupby("share")
        return {
            length: (one["train_s"].iloc[0], one[[score]].rename(columns={score: "x"}))
            for length, one in chosen
        }

    plain = points("plain")
    if share not in plain:
        return None
    own_points, time_s = points(method), plain[share][0]
    # One that is done before the time is up has what it has.
    last_s = max(seconds for seconds, _ in own_points.values())
    found = remedies.at_time(own_points, min(time_s, last_s), "x")
    other = remedies.at_time(plain, time_s, "x")
    return None if np.isnan(found).any() else found - other


if __name__ == "__main__":
    main()
