"""Splats by OpenSplat of captures with and without a fault, judged: evidence of them.

    python -m tools.bench.splat_cases results/temple ... --out results/splat_cases
        --opensplat opensplat/build/opensplat

A capture is a prepared scene, every n-th view of which is held out. Each case is a
folder of photos, transforms.json and points, trained on the CPU in 3 minutes and judged
by `make judge`, whose verdict goes into a log alone. splat_rows.csv is evidence for
`tools.bench.limits fit` or, of held-out captures, `tools.bench.heldout --splats`. What
is there is not made again. OpenSplat needs an option --hold-every, as a patch adds it.
"""

import argparse
import itertools
import json
import os
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pandas as pd

from alignerf.exports import formats
from alignerf.exports import points as exported
from alignerf.io import atomic, images, provenance
from alignerf.scenes import cameras
from tools.bench import faults, planted, splats

# What is planted, and how long is trained.
STEPS, SHORT = 1500, 150
VARIANTS = {
    "good": ("nothing", STEPS),
    "short": ("short", SHORT),
    "wrong_poses": ("poses", STEPS),
    "exposure": ("exposure", STEPS),
    "walker": ("walker", STEPS),
}
STRENGTH = 1
# Photos are trained at most so long, so that 1500 steps take minutes.
TRAINED_PX = 320
TRAINER = "--num-downscales 2 --resolution-schedule 350 --warmup-length 300 --cpu"


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("captures", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--opensplat", type=Path, required=True)
    parser.add_argument("--variants", nargs="+", choices=VARIANTS, default=[*VARIANTS])
    args = parser.parse_args(argv)
    out, rows = args.out.resolve(), []
    for scene, variant in itertools.product(args.captures, args.variants):
        fault, steps = VARIANTS[variant]
        name = f"{scene.name}_{variant}"
        folder = out / "scenes" / name
        if not folder.is_dir():
            write(folder, planted.load(scene, out), fault)
        if not (folder / "splat.ply").is_file():
            train(folder, args.opensplat.resolve(), steps)
        case = {"name": name, "trainer": "OpenSplat", "capture": scene.name}
        case |= {"faults": fault, "reading": "renders", "seed": 0, "strengths": 1}
        if refused := judge(folder, out):
            rows.append(case | {"refused": refused})
        else:
            rows.append(splats.judged(out / "results", case))
        with atomic.replace_file(out / "splat_rows.csv") as path:
            pd.DataFrame(rows).to_csv(path, index=False)


def write(folder, capture, fault):
    """Write photos, cameras and points, as users have them, with a fault."""
    plant, points = faults.PLANTS[fault], capture.points
    colours = colours_of(points, capture)
    rng = np.random.default_rng(zlib.crc32(folder.name.encode()))
    if plant.before:
        capture = plant.before(capture, plant.strengths[STRENGTH], rng)
    arrays = {key: getattr(capture, key) for key in ("split", *faults.CAMERAS)}
    arrays |= dict(zip(("width", "height"), capture.size, strict=True))
    arrays["names"] = np.array(capture.names)
    model = exported.given(arrays, (points, colours))
    with atomic.replace_folder(folder) as made:
        for name, photo in zip(capture.names, capture.photos, strict=True):
            images.write(Path(made, "images", f"{name}.png"), photo)
        model.export_PLY(Path(made, formats.POINTS))
        formats.write_transforms(Path(made, "transforms.json"), arrays, points=True)


def colours_of(points, capture):
    """[m, 3] uint8 of points in the first photo that has them; grey in none."""
    found = np.full((len(points), 3), 128, np.uint8)
    views = zip(capture.photos, capture.pixtocams, capture.camtoworlds, strict=True)
    for photo, *camera in reversed([*views]):
        at, depth = cameras.project(points, *camera)
        shown = (depth > 0) & (at >= 0).all(-1) & (at < capture.size).all(-1)
        column, row = at[shown].astype(int).T
        found[shown] = photo[row, column]
    return found


def train(folder, opensplat, steps):
    """Train a case, every n-th photo by name held out."""
    scene = json.loads((folder / "transforms.json").read_text())
    names = sorted(frame["file_path"] for frame in scene["frames"])
    every = names.index(sorted(scene["test_filenames"])[1])
    options = {"-n": steps, "--hold-every": every, "-o": folder / "splat.ply"}
    options["-d"] = max(1.0, max(scene["w"], scene["h"]) / TRAINED_PX)
    words = [str(word) for option in options.items() for word in option]
    run([str(opensplat), str(folder), *words, *TRAINER.split()], folder, "train.log")


def judge(folder, out):
    """`make judge` of a trained case, with results in OUT/results; why it is refused.

    A judgement that is there is not made again.
    """
    if (out / "results" / folder.name / "verdict.json").is_file():
        return None
    command = [sys.executable, "-m", "alignerf", "judge", "--name", folder.name]
    for key, path in (
        ("--photos", "images"),
        ("--splat", "splat.ply"),
        ("--cameras", "transforms.json"),
    ):
        command += [key, str((folder / path).resolve())]
    try:
        run([*command, "--before", "none"], folder, "judge.log", cwd=out)
    except ValueError:
        told = (folder / "judge.log").read_text(errors="replace").splitlines()
        said = [line for line in told if line.startswith("error: ")]
        if not said:
            raise
        return said[-1].removeprefix("error: ")


def run(command, folder, log, cwd=None):
    """Run a command into a log; ValueError that names the log where it fails."""
    environment = os.environ | {"PYTHONPATH": str(provenance.ROOT)}
    with open(folder / log, "w") as file:
        done = subprocess.run(
            command, cwd=cwd, env=environment, stdout=file, stderr=subprocess.STDOUT
        )
    if done.returncode:
        raise ValueError(f"{folder / log}: ended with {done.returncode}")


if __name__ == "__main__":
    main()
