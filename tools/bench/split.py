"""Is the split of the misalignment right, with trained renders and estimated flow?

Courtyard with pose errors only, motion only, and both: train Table 1's smaller model,
render the test views with their depth, estimate the flow, decompose it, and compare
with the true parts. Mean lengths over the test views' pixels where the true and the
estimated flow are valid; a part is off by its error relative to its true length, or
where that is zero, to the whole true misalignment.

A render of a model that averages misaligned photos is itself displaced from the
undisplaced scene, by nearly as much as the photos are. `less the model's part` takes
off the flow from render to oracle first, which only a scene of known truth has.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import yaml

from alignerf.experiment import check
from alignerf.scenes import cameras
from tools.bench import cases, measure

ROOT = pathlib.Path(__file__).resolve().parents[2]
GOAL = measure.Goal("ours", "<=", 15.0)
CASES = {
    "pose only": {"perturb_px": 1.5, "motion": "none"},
    "motion only": {"perturb_px": 0.0, "motion": "uniform"},
    "both": {"perturb_px": 1.5, "motion": "uniform"},
}
# As `align_view` names them: flow to the photos, and to the oracle.
FLOWS = {"flow": "images", "flow_oracle": "images/truth/oracle"}


def run(options):
    """Four rows for each case: both parts, as they are and less the model's part."""
    demo = yaml.safe_load((ROOT / "workflow/config/table1.yaml").read_text())
    chosen = CASES
    if options.quick:
        chosen = {"both": CASES["both"]}
        demo["models"]["base"] = cases.TINY
        demo["training"] |= {"steps": 40, "warmup_steps": 4, "batch_rays": 128}
    demo = check.checked(demo)
    rows = []
    for name, case in chosen.items():
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            make(folder, demo, case, quick=options.quick)
            for told, extra in (("", []), (", less the model's part", ["flow_oracle"])):
                rows += compare(folder, f"{name}{told}", extra)
    return rows


def scene_of(demo, case, *, quick):
    """Table 1's scene with the case's misalignment and otherwise true poses."""
    scene = demo["scenes"]["courtyard_off"] | {"poses": "truth"}
    scene["perturb_px"] = case["perturb_px"]
    scene["courtyard"] = scene["courtyard"] | {"motion": case["motion"]}
    if quick:
        scene["downscale"] = 1
        scene["courtyard"] |= {"views": 9, "width": 96, "height": 72}
    return json.dumps(scene)


def make(folder, demo, case, *, quick):
    """A scene, its trained model, the test views' renders with depth, their flows."""
    stage("alignerf.poses", config=scene_of(demo, case, quick=quick), out=folder)
    job = {key: demo[key] for key in ("seed", "training")}
    job |= {"stage": "full", "model": demo["models"]["base"], "alignerf": None}
    job = json.dumps(job)
    stage(
        "alignerf.train",
        config=job,
        scene=folder,
        photos=folder / "images",
        checkpoints=folder / "checkpoints",
        sources="bench",
        learnt=folder / "learnt",
        timing=folder / "timing.json",
    )
    stage(
        "alignerf.render_views",
        config=job,
        scene=folder,
        model=folder / "learnt" / "model.msgpack",
        splits="test",
        renders=folder / "renders",
        depth=folder / "depth",
        timing=folder / "render",
    )
    for name, photos in FLOWS.items():
        stage(
            "flow.align",
            renders=folder / "renders" / "test",
            photos=folder / photos,
            flow_out=folder / name,
            stats_out=folder / f"{name}.csv",
            # Hardly trained, a render's flows do not agree to a pixel.
            tolerance_px=16.0 if quick else demo["flow"]["tolerance_px"],
        )


def stage(module, *, root=ROOT, **options):
    """Run a stage of the chain as its rule does; root: the checkout to run."""
    words = [
        str(word)
        for name, value in options.items()
        for word in (f"--{name.replace('_', '-')}", value)
    ]
    done = subprocess.run(
        [sys.executable, "-m", module, *words], cwd=root, capture_output=True, text=True
    )
    if done.returncode != 0:
        raise RuntimeError(f"{module} failed: {done.stderr.strip()[-300:]}")


def compare(folder, name, model_flow):
    """Rows of the camera's and the motion's part, found against true."""
    extra = {"model_flow": folder / model_flow[0]} if model_flow else {}
    stage(
        "flow.decompose",
        renders_depth=folder / "depth" / "test",
        flow=folder / "flow",
        cameras=folder / "cameras.npz",
        split="test",
        out_flow=folder / "parts",
        stats_out=folder / "decomposition.csv",
        **extra,
    )
    lengths = np.array([lengths_px(folder, path) for path in views(folder)])
    camera, camera_true, apart, motion, motion_true, total = lengths.mean(axis=0)
    parts = {
        "camera": (camera, camera_true, f", {apart:.2f} px apart as vectors"),
        "the rest that moves": (motion, motion_true, ""),
    }
    for part, (found, true, note) in parts.items():
        scale = true if true > 0.01 * total else total
        yield measure.Row(
            what=f"{name}: {part}, off by",
            unit="%",
            ours=measure.one(100 * abs(found - true) / scale),
            goal=GOAL,
            note=f"{found:.3f} px found, {true:.3f} px true{note}",
        )


def views(folder):
    return sorted((folder / "parts").glob("*.npz"))


def lengths_px(folder, path):
    """Mean lengths of a view: camera part, true one, their difference, what moved
    otherwise, the true one of that, and the true flow."""
    parts = np.load(path)
    true = np.load(folder / "images" / "truth" / "flow" / path.name)
    camera_px = true_camera_part(folder, path.stem)
    motion_px = true["flow_px"] - camera_px
    where = parts["valid"] & true["valid"]
    moved_px = parts["remainder_px"] * parts["moved"][..., None]
    vectors = (
        parts["camera_px"],
        camera_px,
        parts["camera_px"] - camera_px,
        moved_px,
        motion_px,
        true["flow_px"],
    )
    return [np.linalg.norm(vector[where], axis=-1).mean() for vector in vectors]


def true_camera_part(folder, view):
    """Flow [h, w, 2] of the still scene from the given camera to the true one."""
    given, true = (
        np.load(folder / "cameras.npz"),
        np.load(folder / "images/truth/cameras.npz"),
    )
    i = given["names"].tolist().index(view)
    depth_m = np.load(folder / "images" / "truth" / "depth" / f"{view}.npz")["depth_m"]
    y, x = np.indices(depth_m.shape)
    rays = cameras.pixels_to_rays(x, y, given["pixtocams"][i], given["camtoworlds"][i])
    points = rays.origins + depth_m[..., None].astype(np.float64) * rays.directions
    seen, _ = cameras.project(points, true["pixtocams"][i], true["camtoworlds"][i])
    return seen - np.stack([x + 0.5, y + 0.5], axis=-1)
