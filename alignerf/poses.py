"""Images and cameras of a scene: `python -m alignerf.poses --config JSON --out DIR`.

Writes images/<view>.png (undistorted, at the resolution of training), cameras.npz,
poses.json and, for the embedded courtyard, truth/. All of them appear together, once
everything has succeeded.
"""

import argparse
import json
import logging
import shutil
import time
from pathlib import Path

import numpy as np

from alignerf.command import faults, whole
from alignerf.experiment import settings
from alignerf.scenes import cameras, colmap, llff, prepare, transforms
from alignerf.scenes.courtyard import scene as courtyard
from alignerf.scenes.courtyard import truth

log = logging.getLogger("alignerf.poses")

DEFAULTS = {
    "source": "courtyard",
    "path": None,
    "poses": None,
    "downscale": 1,
    "test_every": 8,
    "perturb_px": 0.0,
    "seed": 0,
    "colmap": {"max_size_px": 1600, "camera_model": None},
    "courtyard": {
        "views": 48,
        "width": 400,
        "height": 300,
        "motion": "uniform",
        "motion_m": 0.02,
        "moving": list(courtyard.MOVING),
        "supersample": 2,
        # Leaves as much near the highest frequency as a real photo made smaller has:
        # unblurred textures lose ten times more than photos when they are resampled.
        "lens_sigma_px": 1.4,
    },
}
# Source -> the ways in which it can have poses, the default first.
POSES = {
    "courtyard": ("colmap", "truth"),
    "photos": ("colmap",),
    "transforms": ("given",),
    "llff": ("given",),
}
PRODUCTS = ("images", "truth", "cameras.npz", "poses.json")


def main(config, out):
    """Run one scene's slice of the config; `out` is the scene's folder of results."""
    started = time.monotonic()
    config = check_config(config)
    out = Path(out)
    with whole.scratch_folder(out) as scratch:
        views, report, scene = load_source(config, scratch)
        photo_size = views.width, views.height
        views = prepare.downscale(prepare.sort_by_name(views), config["downscale"])
        rng = np.random.default_rng([config["seed"], 1])
        views = views._replace(
            camtoworlds=cameras.perturb_poses(
                views.camtoworlds, views.pixtocams, config["perturb_px"], rng
            )
        )
        split = prepare.split_views(len(views.names), test_every=config["test_every"])
        fresh = scratch / "new"
        prepare.write_views(fresh, views, split=split)
        if scene is not None:
            log.info("rendering the truth of %d views", len(views.names))
            scene = truth.select(scene, views.names)
            report["true_misalignment_px"] = truth.write_truth(
                fresh / "truth", scene, views, split=split
            )
        report |= describe_views(views, photo_size, split, config)
        report["time_s"] = round(time.monotonic() - started, 1)
        (fresh / "poses.json").write_text(json.dumps(report, indent=1) + "\n")
        publish(fresh, out)
    log.info("%s: %d of %d views", out, report["registered"], report["total"])


def check_config(config):
    """The slice with every default filled; ValueError names what is wrong."""
    config = faults.fill_defaults(config, DEFAULTS)
    source = config["source"]
    if source not in POSES:
        raise ValueError(f"source: {source!r} is none of {', '.join(POSES)}")
    config["poses"] = config["poses"] or POSES[source][0]
    if config["poses"] not in POSES[source]:
        raise ValueError(
            f"poses: {config['poses']!r} is not possible for source {source!r}, "
            f"only {' or '.join(POSES[source])}"
        )
    model = config["colmap"]["camera_model"]
    if source == "courtyard" and model not in (None, "PINHOLE", "SIMPLE_PINHOLE"):
        # Undoing a distortion that is not there would move photos off their true flow.
        raise ValueError(f"colmap.camera_model: courtyard is a PINHOLE, not {model}")
    if source != "courtyard" and not config["path"]:
        raise ValueError(f"path: source {source!r} needs one")
    least = {"downscale": 1, "test_every": 2, "perturb_px": 0, "seed": 0}
    faults.check_least(config, least)
    faults.check_least(config["colmap"], {"max_size_px": 1}, name="colmap.")
    least = dict.fromkeys(("views", "width", "height", "supersample"), 1)
    least |= {"lens_sigma_px": 0}
    faults.check_least(config["courtyard"], least, name="courtyard.")
    return config


def load_source(config, scratch):
    """(views at full size, the report so far, the embedded scene or None)."""
    if config["source"] == "transforms":
        views, left_out = transforms.read(config["path"])
        return views, registration(views.names, left_out), None
    if config["source"] == "llff":
        views = llff.read(config["path"])
        return views, registration(views.names, []), None
    if config["source"] == "photos":
        views, report = pose_photos(
            config["path"], scratch, config, camera_model="OPENCV"
        )
        return views, report, None
    scene = truth.build_courtyard(**config["courtyard"], seed=config["seed"])
    folder = scratch / "photos"
    folder.mkdir()
    log.info("rendering %d photos of the courtyard", len(scene.names))
    truth.write_photos(folder, scene)
    if config["poses"] == "colmap":
        return *pose_courtyard(folder, scratch, scene, config), scene
    views = prepare.PosedViews(
        names=scene.names,
        pixtocams=scene.pixtocams,
        camtoworlds=scene.camtoworlds,
        width=scene.width,
        height=scene.height,
        load=lambda i: prepare.load_image(folder / f"{scene.names[i]}.png"),
    )
    return views, registration(scene.names, []), scene


def pose_photos(folder, scratch, config, *, camera_model, where=None):
    """Views of a folder of photos by COLMAP, undistorted, and the poses report."""
    views, model, focal_px = colmap.pose_folder(
        folder,
        scratch,
        camera_model=config["colmap"]["camera_model"] or camera_model,
        max_size_px=config["colmap"]["max_size_px"],
        seed=config["seed"],
        where=where or str(folder),
    )
    report = registration(model.names, model.left_out) | {
        "mean_reprojection_error_px": model.mean_reprojection_error_px,
        "points": model.points,
        "points_in_3_views": model.points_in_3_views,
        "models": model.models,
        "exif_focal_px": focal_px,
    }
    return views, report


def pose_courtyard(folder, scratch, scene, config):
    """The courtyard's photos through COLMAP, the frame aligned to the true one.

    The focal length is COLMAP's own, as for photos without EXIF: it comes within
    0.2 % of the true one, and holding that one changed little. What is left is the
    work of the moving objects: with 48 views of 400x300, the estimated cameras see
    the still scene 0.77 px of a 200x150 image from where it is on average, and
    0.07 px when nothing moves.
    """
    views, report = pose_photos(
        folder, scratch, config, where="courtyard", camera_model="SIMPLE_PINHOLE"
    )
    true = truth.select(scene, views.names)
    similarity = cameras.align_similarity(views.camtoworlds, true.camtoworlds)
    views = views._replace(
        camtoworlds=cameras.apply_similarity(views.camtoworlds, *similarity)
    )
    report["compared_to_truth"] = truth.compare_cameras(
        (views.pixtocams, views.camtoworlds), (true.pixtocams, true.camtoworlds)
    )
    return views, report


def registration(names, left_out):
    """The part of the report that every source has."""
    return {
        "registered": len(names),
        "total": len(names) + len(left_out),
        "left_out": list(left_out),
        "mean_reprojection_error_px": None,
        "points": None,
        "models": None,
    }


def describe_views(views, photo_size, split, config):
    """The part of the report about what training reads."""
    camtopix = np.linalg.inv(views.pixtocams)
    return {
        "source": config["source"],
        "poses": config["poses"],
        "width": views.width,
        "height": views.height,
        "photo_width": photo_size[0],
        "photo_height": photo_size[1],
        "focal_px": [float(camtopix[:, i, i].mean()) for i in (0, 1)],
        "perturb_px": config["perturb_px"],
        "train_views": int((split == "train").sum()),
        "test_views": int((split == "test").sum()),
    }


def publish(fresh, out):
    """Move what was made into the scene's folder, the report last."""
    for name in PRODUCTS:
        if (fresh / name).exists():
            whole.move(fresh / name, out / name)
        elif (out / name).exists():
            # Left by another source of the same scene name, and no longer true.
            shutil.rmtree(out / name)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--config", required=True, help="JSON, or a file of it")
    parser.add_argument("--out", required=True, type=Path, help="results/SCENE")
    options = parser.parse_args()
    faults.run(lambda: main(settings.read_config(options.config), options.out))
