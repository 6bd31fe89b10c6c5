"""Is the verdict right? Variants of courtyard with known faults, alone and in pairs.

Each is made, trained for a minute, rendered, aligned and judged; its row says which
faults were named. Thresholds were chosen on seeds 0 to 4.
"""

import hashlib
import json
import pathlib
import shutil
import subprocess
import sys

import cv2
import numpy as np

from alignerf.io import images
from tools.bench import measure, planted

ROOT = pathlib.Path(__file__).resolve().parents[2]
SEEDS = (0, 2, 4, 5)
STEPS, FEW_STEPS = 1500, 125
# Fault -> the cause that is to be named. What has none is below what can be told.
CAUSES = {
    "pose": "camera",
    "motion": "motion",
    "sparse": "sparse",
    "short": "undertrained",
    "blur": "blurred",
    "exposure": "exposure",
    "pixel": "lens_shift",
    "lens": "lens_distortion",
}
VARIANTS = {
    "nothing": (),
    **{name: (name,) for name in CAUSES},
    "half a pixel of pose": ("half_pose",),
    "pose, motion": ("pose", "motion"),
    "pose, short": ("pose", "short"),
    "pose, exposure": ("pose", "exposure"),
    "pose, sparse": ("pose", "sparse"),
    "motion, blur": ("motion", "blur"),
    "motion, short": ("motion", "short"),
    "blur, exposure": ("blur", "exposure"),
    "exposure, lens": ("exposure", "lens"),
    "pixel, motion": ("pixel", "motion"),
}
MODEL = {
    "proposal": {"levels": 3, "max_resolution": 128},
    "field": {"log2_hashmap_size": 15, "max_resolution": 1024},
}


def run(options):
    """Rows: 1 where exactly the faults that are there were named, else 0."""
    seeds, variants = SEEDS, VARIANTS
    if options.quick:
        seeds, variants = SEEDS[:1], {"nothing": ()}
    rows = []
    for seed in seeds:
        for name, faults in variants.items():
            folder = options.out / "verdicts" / f"seed{seed}" / name.replace(", ", "_")
            found = judged(folder.absolute(), faults, seed, quick=options.quick)
            rows.append(row_of(f"{name}, seed {seed}", faults, found))
    return rows


def row_of(what, faults, found):
    """What was named, against what is there."""
    named = {finding["cause"] for finding in found["findings"]}
    there = {CAUSES[fault] for fault in faults if fault in CAUSES}
    # After so little training nothing of alignment is told, and that is right.
    untold = {"camera", "motion"} if "short" in faults else set()
    # Half a pixel of pose may be told, or not; the sparse scene has few views, too.
    optional = {"camera"} if "half_pose" in faults else set()
    optional |= {"few_views"} if "sparse" in faults else set()
    right = named - optional == there - untold
    note = f"there: {', '.join(sorted(there)) or 'nothing'}; named: "
    note += f"{', '.join(sorted(named)) or 'nothing'}; {found['verdict'][0]}"
    return measure.Row(what, "right", measure.one(float(right)), note=note)


def judged(folder, faults, seed, *, quick=False):
    """verdict.json of a variant; what is there already is not made again."""
    done = folder / "verdict.json"
    if not done.is_file():
        folder.mkdir(parents=True, exist_ok=True)
        make_scene(folder, faults, seed, quick=quick)
        for command in commands(folder, faults, seed, quick=quick):
            subprocess.run(
                [sys.executable, "-m", *map(str, command)],
                check=True,
                cwd=ROOT,
                stdout=subprocess.DEVNULL,
            )
    return json.loads(done.read_text())


def make_scene(folder, faults, seed, *, quick):
    """The scene's folder, its photos or cameras spoilt."""
    scene = {
        "source": "courtyard",
        "poses": "truth",
        "triangulate": True,
        "seed": seed,
        "downscale": 2,
        "perturb_px": 2.0 * ("pose" in faults) + 0.5 * ("half_pose" in faults),
        "courtyard": {"motion": "uniform" if "motion" in faults else "none"},
    }
    if "sparse" in faults:
        scene |= {"test_every": 3}
        scene["courtyard"]["views"] = 15
    if quick:
        scene["courtyard"] |= {"views": 16, "width": 128, "height": 112}
    config = json.dumps(scene, sort_keys=True)
    digest = hashlib.sha256(config.encode()).hexdigest()[:12]
    # Faults of photos and cameras begin with the same scene.
    shared = folder.parent / "scenes" / digest
    if not (shared / "poses.json").is_file():
        shared.mkdir(parents=True, exist_ok=True)
        subprocess.run(
            [
                *(sys.executable, "-m", "alignerf.poses", "--config", config),
                *("--out", str(shared)),
            ],
            check=True,
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
        )
    shutil.copytree(shared, folder, dirs_exist_ok=True)
    spoil(folder, faults, np.random.default_rng([seed, 7]))


def spoil(folder, faults, rng):
    """Faults that the courtyard does not have of its own."""
    paths = sorted((folder / "images").glob("*.png"))
    soft = rng.permutation(len(paths))[: len(paths) // 5]
    stops = rng.normal(scale=0.25, size=len(paths))
    for place, path in enumerate(paths):
        image = images.read(path)
        if "lens" in faults:
            image = bent(image, corner_px=1.5)
        if "blur" in faults and place in soft:
            image = cv2.GaussianBlur(image, (0, 0), 2.0)
        if "exposure" in faults:
            image = planted.brighter(image, stops[place])
        images.write(path, image)
    if "pixel" in faults:
        path = folder / "cameras.npz"
        with np.load(path) as stored:
            found = dict(stored)
        camtopix = np.linalg.inv(found["pixtocams"])
        # Half a pixel of the photo, which has twice as many, would be a quarter.
        camtopix[:, 0, 2] += 0.5
        camtopix[:, 1, 2] += 0.5
        np.savez(path, **found | {"pixtocams": np.linalg.inv(camtopix)})


def bent(image, *, corner_px):
    """The image as a lens bends it that moves its corners outwards by so much."""
    height, width = image.shape[:2]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    x, y = x - (width - 1) / 2, y - (height - 1) / 2
    half = np.hypot(width, height) / 2
    share = corner_px / half * (x**2 + y**2) / half**2
    shares = (1 - share).astype(np.float32)
    at = x * shares + (width - 1) / 2, y * shares + (height - 1) / 2
    at = [np.float32(part) for part in at]
    border = cv2.BORDER_REFLECT_101
    return cv2.remap(image, *at, cv2.INTER_LANCZOS4, borderMode=border)


def commands(folder, faults, seed, *, quick):
    """The stages from training to verdict."""
    steps = FEW_STEPS if "short" in faults else STEPS
    steps = 4 if quick else steps
    job = {
        "seed": seed,
        "stage": "full",
        "model": MODEL,
        "training": {"steps": steps},
        "alignerf": None,
    }
    base, cameras = folder / "round0", folder / "cameras.npz"
    base.mkdir(exist_ok=True)
    job = ("--config", json.dumps(job))
    yield (
        *("alignerf.train", "--scene", folder, *job, "--threads", 1),
        *("--checkpoints", base / "checkpoints", "--timing", base / "timing.json"),
        *("--learnt", base / "learnt"),
    )
    yield (
        *("alignerf.render_views", "--scene", folder, *job, "--threads", 1),
        *("--model", base / "learnt" / "model.msgpack"),
        *("--splits", "train", "test", "--renders", base / "renders"),
        *("--depth", base / "depth", "--timing", base / "render"),
    )
    yield (
        *("flow.align", "--method", "deepflow", "--match-blur", "--kernel", "lanczos"),
        *("--splits", "train", "test", "--renders", base / "renders"),
        *("--photos", folder / "images", "--depth", base / "depth"),
        *("--flow-out", base / "flow", "--stats-out", base / "displacement"),
    )
    for name in ("train", "test"):
        yield (
            *("flow.decompose", "--renders-depth", base / "depth" / name),
            *("--flow", base / "flow" / name, "--cameras", cameras, "--split", name),
            *("--out-flow", base / "parts_photos" / name),
            *("--stats-out", base / f"decomposition_photos_{name}.csv"),
        )
    yield (
        *("alignerf.verdict", "--scene", folder, "--base", base),
        *("--out", folder / "verdict.json", "--views", folder / "views.csv"),
    )
