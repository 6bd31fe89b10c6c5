"""Is `make judge` right? Renders of finished runs, as they are and with faults planted.

--results: folder of results of a run, such as of workflow/config/judged.yaml. Of each
scene with round 0 of --method, photos and renders are judged as another program's would
be. Right is a row whose verdict names what that of the run itself named, and what was
planted.
"""

import json
import pathlib
import shutil
import subprocess
import sys

import cv2
import numpy as np

from alignerf.exports import formats
from alignerf.io import csv_files, images
from alignerf.scenes import cameras, prepared
from flow.camera import motion
from flow.warping import warp
from tools.bench import measure

ROOT = pathlib.Path(__file__).resolve().parents[2]
# Fault -> the cause that is to be named; None: the photo alone is.
PLANTS = {
    "nothing": None,
    "one photo blurred": None,
    "exposure": "exposure",
    "half a pixel": "lens_shift",
    "two renders swapped": "pairs",
    "cameras off": "camera",
}
# Of one photo's blur, of exposure in stops, of cameras in px of the renders.
BLUR_PX, STOPS_EV, CAMERAS_PX = 3.0, 0.25, 1.5
# What the run says of its training or its poses, and a judge cannot know.
OF_RUN = {"undertrained", "unregistered", "few_views"}


def run(options):
    """Rows: 1 where exactly the faults that are there were named, else 0."""
    rows = []
    for base in sorted(options.results.glob(f"*/{options.method}/round0")):
        scene = base.parents[1]
        own = scene / "verdict.json"
        if not (own.is_file() and (base / "renders" / "train").is_dir()):
            continue
        expected = json.loads(own.read_text())
        for name, cause in PLANTS.items():
            out = options.out / "judged" / scene.name / name.replace(" ", "_")
            place = plant(scene, base, out.absolute(), name)
            rows.append(row_of(scene.name, name, cause, place, expected, out))
    return rows


def row_of(scene, name, cause, place, expected, out):
    """What was named, against what the run has named and what was planted."""
    found = judged(out.absolute())
    before = {f["cause"] for f in expected["findings"]} - OF_RUN
    named = {f["cause"] for f in found["findings"]} - OF_RUN
    there = before | {cause} - {None}
    # A shift that all renders share is a turn of all cameras, too.
    optional = {"camera"} if name == "half a pixel" else set()
    right = named - optional == there - optional
    table = csv_files.read(out / "views.csv")
    stands_out = table["stands_out"].fillna("").astype(str)
    views = dict(zip(table["view"], stands_out, strict=True))
    if name == "nothing":
        # What the run calls unclear is as small as the photos that are judged here.
        states = {found["state"], expected["state"]}
        right &= states != {"aligned", "misaligned"}
    elif name == "one photo blurred":
        right = named - {"blurred"} == before - {"blurred"}
        right &= "blurred" in views[place]
    elif name == "two renders swapped":
        right &= found["evidence"]["pairs"]["faults"].keys() == place
    note = f"there: {', '.join(sorted(there)) or 'nothing'}; named: "
    note += f"{', '.join(sorted(named)) or 'nothing'}; {found['headline']}"
    return measure.Row(
        f"{scene}, {name}", "right", measure.one(float(right)), note=note
    )


def plant(scene, base, out, name):
    """Write photos/, renders/, depth/ and transforms.json; returns what was chosen."""
    if out.is_dir():
        shutil.rmtree(out)
    loaded = prepared.load(scene)
    arrays = prepared.read_cameras(scene / "cameras.npz")
    (out / "cameras").mkdir(parents=True)
    formats.write_transforms(out / "cameras" / "transforms.json", arrays)
    rng = np.random.default_rng(len(loaded.names))
    first, second = map(int, rng.choice(loaded.views("train"), 2, replace=False))
    swap = {first: second, second: first}
    one = int(loaded.views("train")[len(loaded.views("train")) // 2])
    for view, view_name in enumerate(loaded.names):
        split = loaded.split[view]
        file = f"{view_name}.png"
        photo = images.read(scene / "images" / file)
        source = swap.get(view, view) if name == "two renders swapped" else view
        render = images.read(base / "renders" / split / f"{loaded.names[source]}.png")
        with np.load(base / "depth" / split / f"{view_name}.npz") as data:
            depth = data["depth"]
        if name == "one photo blurred" and view == one:
            photo = cv2.GaussianBlur(photo, (0, 0), BLUR_PX)
        if name == "exposure":
            bright = photo * 2.0 ** rng.normal(scale=STOPS_EV)
            photo = np.clip(np.round(bright), 0, 255).astype(np.uint8)
        if name == "half a pixel":
            render = warp.warp(render, np.full((*render.shape[:2], 2), 0.5, np.float32))
        if name == "cameras off":
            photo = warp.warp(photo, moved(rng, loaded.pixtocams[view], depth))
        for folder, image in (("photos", photo), (f"renders/{split}", render)):
            (out / folder).mkdir(parents=True, exist_ok=True)
            images.write(out / folder / file, image)
        (out / "depth").mkdir(exist_ok=True)
        np.save(out / "depth" / f"{view_name}.npy", depth)
    scale = cameras.frame_of(arrays["camtoworlds"]).scale
    (out / "scale.json").write_text(json.dumps(1 / scale))
    return {loaded.names[v] for v in swap} if "swapped" in name else loaded.names[one]


def moved(rng, pixtocam, depth):
    """The flow [h, w, 2] of a camera that is moved by CAMERAS_PX in the middle."""
    points = motion.points_of(pixtocam, depth)
    turn, step = rng.normal(size=3), rng.normal(size=3) * np.median(depth)
    whole = motion.Motion(1e-4 * turn, 1e-4 * step, 0.0)
    length_px = np.median(np.linalg.norm(motion.flow(whole, points), axis=-1))
    factor = 1e-4 * CAMERAS_PX / length_px
    return motion.flow(motion.Motion(factor * turn, factor * step, 0.0), points).astype(
        np.float32
    )


def judged(out):
    """verdict.json of what was planted, by the stages that `make judge` runs."""
    splits = [s for s in prepared.SPLITS if (out / "renders" / s).is_dir()]
    scale = json.loads((out / "scale.json").read_text())
    scene = {
        "source": "external_renders",
        "path": str(out / "photos"),
        "external_renders": {
            "renders": str(out / "renders"),
            "splits": splits,
            "cameras": str(out / "cameras"),
            "depth": str(out / "depth"),
            "depth_kind": "depth",
            "depth_scale": scale,
        },
    }
    for command in commands(out, out / "scene", scene, splits):
        done = subprocess.run(
            [sys.executable, "-m", *map(str, command)],
            cwd=ROOT,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            raise ValueError(f"{out}: {command[0]}: {done.stderr[-500:]}")
    return json.loads((out / "verdict.json").read_text())


def commands(out, folder, scene, splits):
    """The stages from pairs to verdict."""
    base = folder / "theirs"
    base.mkdir(parents=True, exist_ok=True)
    yield "alignerf.poses", "--config", json.dumps(scene), "--out", folder
    renders, depth, flow = (base / n for n in ("renders", "depth", "flow"))
    photos, masks = folder / "images", folder / prepared.MASKS
    yield (
        *("alignerf.external.train", "--config", json.dumps({"external": {}})),
        *("--scene", folder, "--photos", photos, "--cameras", folder / "cameras.npz"),
        *("--learnt", base / "learnt", "--timing", base / "timing.json"),
    )
    yield (
        *("alignerf.external.render", "--scene", folder, "--splits", *splits),
        *("--renders", renders, "--depth", depth, "--timing", base / "render"),
    )
    yield (
        *("flow.align", "--splits", *splits, "--renders", renders, "--photos", photos),
        *("--masks", masks, "--depth", depth, "--flow-out", flow),
        *("--stats-out", base / "displacement", "--threads", 2),
    )
    for name in splits:
        yield (
            *("flow.decompose", "--renders-depth", base / "depth" / name),
            *("--flow", base / "flow" / name, "--cameras", folder / "cameras.npz"),
            *("--split", name, "--out-flow", base / "parts_photos" / name),
            *("--stats-out", base / f"decomposition_photos_{name}.csv"),
        )
    yield (
        *("flow.control_sets", "--renders", base / "renders" / splits[0]),
        *("--photos", photos, "--masks", masks, "--flow", base / "flow" / splits[0]),
        *("--lengths", base / "overfit.csv"),
    )
    yield (
        *("alignerf.verdict", "--scene", folder, "--base", base),
        *("--overfit", base / "overfit.csv", "--out", out / "verdict.json"),
        *("--views", out / "views.csv"),
    )
