"""Remedies within one training against plain training, on prepared scenes.

    python -m tools.bench.in_loop --out rows.csv --lengths 0.5 1 2
        --config workflow/config/evidence/remedies.yaml --scenes results/both_wrong ...

Trains methods of the config on each scene, two at a time with one thread each, and adds
a line to the CSV for each test view; what is there is not trained again. Method `true`
is plain training by true cameras. Tables of it: `tools.bench.in_loop_tables`. Pose
errors are to the scene's truth. Where there is none, they are to the cameras as given;
of NAME_off, whose poses were perturbed, to those of NAME, which lies beside it.
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
from alignerf.io import images, yaml_files

COLUMNS = ("scene", "seed", "share", "method", "view", "oracle_db", "standard_db")
COLUMNS += ("fair_db", "fitted_db", "detail")
COLUMNS += ("train_s", "align_s", "given_px", "after_px")
# The method that is no method.
TRUE = "true"
# Of a fair score, in the stage that makes it.
SQUARES, MARGIN = 4, 0.25


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--config", type=Path, required=True)
    parser.add_argument("--scenes", nargs="+", required=True)
    parser.add_argument("--methods", nargs="+", default=["plain", "aligned"])
    parser.add_argument("--lengths", nargs="+", type=float, default=[1.0])
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args(argv)
    done = set()
    if args.out.exists():
        there = pd.read_csv(args.out)
        if list(there) != list(COLUMNS):
            raise ValueError(f"{args.out}: other columns than {', '.join(COLUMNS)}")
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
    """The job of a method of a config on a scene, `share` times as long, as JSON."""
    read = yaml_files.read(config)
    steps = round(share * read["training"]["steps"])
    kept = {"scenes": {"scene": {"source": "courtyard"}}, "seed": seed_of(scene)}
    kept |= {"models": read.get("models", {"base": {}}), "training": {"steps": steps}}
    method = method.replace(TRUE, "plain")
    kept["methods"] = {name: read["methods"][name] for name in ("plain", method)}
    experiment = plan.Experiment(check.checked(kept))
    return experiment.at("scene", method, 0).job.text


def measure(config, scene, share, method):
    """Train, and a row for each test view."""
    from alignerf.scenes import prepared
    from alignerf.training import renderer

    scene, job = Path(scene), job_of(config, scene, share, method)
    truth, adjusted = scene / "images" / "truth", scene / prepared.ADJUSTED
    adjusts = yaml_files.read(config)["methods"].get(method, {}).get("adjust")
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        command = [sys.executable, "-m", "alignerf.train", "--config", job]
        command += ["--scene", str(scene), "--checkpoints", str(out / "checkpoints")]
        command += ["--learnt", str(out / "learnt"), "--threads", "1"]
        command += ["--timing", str(out / "timing")]
        command += ["--truth", str(truth)] if truth.is_dir() else []
        command += ["--cameras", str(adjusted / "train.npz")] if adjusts else []
        if method == TRUE:
            command += ["--cameras", str(with_true_cameras(scene, out / "true.npz"))]
        subprocess.run(command, check=True, capture_output=True)
        timing = json.loads((out / "timing").read_text())
        loaded = prepared.load(scene, out / "learnt" / "cameras.npz")
        model, params = renderer.read_model(
            job, out / "learnt" / "model.msgpack", loaded
        )
        render = renderer.make_renderer(model, params, loaded.width, loaded.height)
    aligned = timing.get("alignments", [])
    error = timing.get("pose_error_px", {})
    if (aligned or adjusts) and not error:
        error = error_of(scene, loaded, render)
    before_s = 0.0
    if adjusts:
        before_s = json.loads((adjusted / "report.json").read_text())["time_s"]
    shared = {
        "scene": name_of(scene),
        "seed": seed_of(scene),
        "share": share,
        "method": method,
        # Adjusting comes before, and counts.
        "train_s": round(timing["train_time_s"] + before_s, 1),
        "align_s": round(sum(row["time_s"] for row in aligned), 3) + before_s,
        "given_px": error.get("given"),
        "after_px": error.get("after"),
    }
    return [
        shared | scores(loaded, render, view, truth) for view in loaded.views("test")
    ]


def with_true_cameras(scene, path):
    """Write cameras.npz of a scene with true training cameras; held-out ones stay."""
    from alignerf.scenes import prepared

    arrays, true = prepared.read_cameras(scene / "cameras.npz"), true_cameras(scene)
    learnt = arrays["split"] == "train"
    for key in ("pixtocams", "camtoworlds"):
        arrays[key] = np.where(learnt[:, None, None], true[key], arrays[key])
    np.savez(path, **arrays)
    return path


def true_cameras(scene):
    """The arrays of the true cameras: the truth's, or those of the scene NAME."""
    from alignerf.scenes import prepared

    path = scene / "images" / "truth" / "cameras.npz"
    if not path.is_file():
        path = scene.with_name(scene.name.removesuffix("_off")) / "cameras.npz"
    return prepared.read_cameras(path)


def error_of(scene, loaded, render):
    """{given, after}: pose error in px, at the depth that held-out views have."""
    from alignerf.scenes import cameras as all_cameras
    from alignerf.scenes import prepared
    from alignerf.sfm import pose_error

    given = prepared.load(scene)
    true = true_cameras(scene)
    if list(true["names"]) != list(given.names):
        raise ValueError(f"{scene}: the true cameras are of other photos")
    cameras = [
        (loaded.pixtocams[v], loaded.camtoworlds[v]) for v in loaded.views("test")
    ]
    depth = float(np.median([np.median(render(*camera)[1]) for camera in cameras]))
    depth /= all_cameras.frame_of(true["camtoworlds"]).scale
    far = np.full((loaded.height, loaded.width), depth)
    points = {v: pose_error.points_of(true, v, far) for v in loaded.views("train")}
    return {
        name: pose_error.median_px(state, true, points)
        for name, state in {"given": given, "after": loaded}.items()
    }


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
    from flow.estimation import estimate
    from flow.warping import controls

    block_px = max(1, min(photo.shape[:2]) // SQUARES)
    half = controls.checkerboard(*photo.shape[:2], block_px=block_px)
    flow_px, valid, _ = estimate.flow_and_validity(image, photo)
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


if __name__ == "__main__":
    main()
