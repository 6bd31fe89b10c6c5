"""Images and cameras of a scene: `python -m alignerf.poses --config JSON --out DIR`.

Writes images/<view>.png (undistorted, at the resolution of training), cameras.npz,
poses.json and, for the embedded courtyard, truth/. Nothing appears before everything
has succeeded; poses.json comes last, and says that the rest is whole.
"""

import argparse
import json
import logging
import shutil
import time
from pathlib import Path

import numpy as np

from alignerf.command import faults, images, whole
from alignerf.experiment import check, jobs, schema, settings
from alignerf.scenes import (
    blender,
    cameras,
    colmap,
    llff,
    mipnerf360,
    prepare,
    prepared,
    transforms,
)
from alignerf.scenes.capture import triangulate
from alignerf.scenes.courtyard import scene as courtyard
from alignerf.scenes.courtyard import truth

log = logging.getLogger("alignerf.poses")

# As in `verdict.causes`; a test holds both equal. Were they taken from there, every
# change of a threshold would make all poses anew.
FEW_TRAIN_VIEWS, FEW_TEST_VIEWS = 12, 5
# With `downscale: auto`: a training that sees each half a time takes minutes on a core.
# Many photos may have more together, rather than sides under this.
MOST_PIXELS, LEAST_SIDE_PX = 10_000_000, 200
PRODUCTS = ("images", "truth", "colmap", "cameras.npz", "poses.json")


def main(config, out):
    """Run one scene's slice of the config; `out` is the scene's folder of results."""
    started = time.monotonic()
    config = checked(config)
    out = Path(out)
    with whole.scratch_folder(out) as scratch:
        views, report, scene = READERS[config["source"]](config, scratch)
        photo_size = views.width, views.height
        views = prepare.sort_by_name(views)
        report["downscale_decided"] = config["downscale"] == "auto"
        if report["downscale_decided"]:
            config["downscale"] = prepare.factor_for(views, MOST_PIXELS, LEAST_SIDE_PX)
            log.info("downscale: %d", config["downscale"])
        views = prepare.downscale(views, config["downscale"])
        prepared.check_views(config["path"] or out, views)
        rng = np.random.default_rng([config["seed"], 1])
        views = views._replace(
            camtoworlds=cameras.perturb_poses(
                views.camtoworlds, views.pixtocams, config["perturb_px"], rng
            )
        )
        split = views.split
        if split is None:
            every = config["test_every"]
            split = prepare.split_views(len(views.names), test_every=every)
        check_enough(split, config["least_train_views"], config["path"] or out)
        warn_of_few(out, split)
        fresh = scratch / "new"
        prepare.write_views(fresh, views, split=split)
        if settings.wants_points(config) and views.points is None:
            report |= add_points(fresh, scratch, photo_size[0] / views.width, config)
        if scene is not None:
            log.info("rendering the truth of %d views", len(views.names))
            scene = truth.select(scene, views.names)
            report["true_misalignment_px"] = truth.write_truth(
                fresh / "truth",
                scene,
                views,
                split=split,
                perturb_px=config["perturb_px"],
            )
        if (scratch / "colmap").is_dir():
            whole.move(scratch / "colmap", fresh / "colmap")
        report |= describe_views(views, photo_size, split, config)
        report["time_s"] = round(time.monotonic() - started, 1)
        (fresh / "poses.json").write_text(json.dumps(report, indent=1) + "\n")
        publish(fresh, out)
    log.info("%s: %d of %d views", out, report["registered"], report["total"])


def check_enough(split, least, where):
    """ValueError where too few views are left to learn from."""
    count = int((split == "train").sum())
    if count < least:
        raise ValueError(
            f"{where}: {count} of {len(split)} views to learn from are too few. Take "
            "20 or more photos that overlap, or hold out fewer (test_every), or lower "
            "least_train_views"
        )


def warn_of_few(out, split):
    """Say now what the verdict will say after all trainings."""
    counts = {name: int((split == name).sum()) for name in prepared.SPLITS}
    if counts["train"] < FEW_TRAIN_VIEWS or counts["test"] < FEW_TEST_VIEWS:
        log.warning(
            "%s: %d views to learn from and %d to judge by are few: under %d and %d no "
            "difference can be told from chance",
            *(out, counts["train"], counts["test"], FEW_TRAIN_VIEWS, FEW_TEST_VIEWS),
        )


def checked(values):
    """A scene's slice of the config with its defaults; ValueError names a fault."""
    schema.check(settings.Scene, values)
    config = schema.filled(settings.Scene, values)
    config["poses"] = settings.poses_of(config)
    config["seed"] = config["seed"] or 0
    check.check_scene(config)
    return config


def load_photos(config, scratch):
    """Photos by COLMAP: (views at full size, the report so far, no truth)."""
    views, report = pose_photos(config["path"], scratch, config, camera_model="OPENCV")
    return views, report, None


def load_transforms(config, scratch):
    """The same of a transforms.json, with the poses that it gives."""
    views, left_out = transforms.read(config["path"], config["background"])
    return views, registration(views.names, left_out), None


def load_blender(config, scratch):
    """The same of NeRF's synthetic scenes, with their own split."""
    views, left_out = blender.read(config["path"], config["background"])
    return views, registration(views.names, left_out), None


def load_mipnerf360(config, scratch):
    """The same of mip-NeRF 360's layout, with the poses of its COLMAP model."""
    views, left_out = mipnerf360.read(config["path"], config["images"])
    return views, registration(views.names, left_out), None


def load_llff(config, scratch):
    """The same of LLFF's poses_bounds.npy."""
    views = llff.read(config["path"])
    return views, registration(views.names, []), None


def load_courtyard(config, scratch):
    """The same of the embedded scene, which knows its truth: it comes last."""
    made = config["courtyard"]
    if made["moving"] is None:
        made = made | {"moving": list(courtyard.MOVING)}
    scene = truth.build_courtyard(**made, seed=config["seed"])
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
        load=lambda i: images.read(folder / f"{scene.names[i]}.png"),
    )
    return views, registration(scene.names, []), scene


# Source, as settings.SOURCES has them -> its reader.
READERS = {
    "courtyard": load_courtyard,
    "photos": load_photos,
    "transforms": load_transforms,
    "llff": load_llff,
    "mipnerf360": load_mipnerf360,
    "blender": load_blender,
}


def pose_photos(folder, scratch, config, *, camera_model, where=None):
    """Views of a folder of photos by COLMAP, undistorted, and the poses report."""
    views, model, taken = colmap.pose_folder(
        folder,
        scratch,
        camera_model=config["colmap"]["camera_model"] or camera_model,
        max_size_px=config["colmap"]["max_size_px"],
        seed=config["seed"],
        where=where or str(folder),
        background=config["background"],
        masks=config["masks"],
    )
    check_registered(model, config["colmap"]["least_registered"], where or folder)
    report = registration(model.names, model.left_out) | {
        "mean_reprojection_error_px": model.mean_reprojection_error_px,
        "points": len(model.points),
        "points_in_3_views": model.points_in_3_views,
        "models": model.models,
        **describe_photos(model, taken),
    }
    return views, report


def add_points(fresh, scratch, photo_scale, config):
    """Triangulate what the given views see: the part of the report about points.

    The source's own bounds are kept. photo_scale: a photo's width over its view's;
    errors of the report are in pixels of the photo.
    """
    views = prepared.read_cameras(fresh / "cameras.npz")
    found = triangulate.triangulate(
        fresh / "images", scratch, views, seed=config["seed"]
    )
    if not len(found.points):
        log.warning("%s: its views share no points", config["path"] or config["source"])
        return {}
    if not (fresh / prepared.BOUNDS).exists():
        points = fresh / prepared.POINTS
        np.savez(points, points=found.points, colours=found.colours)
    log.info(
        "%d points, which the given cameras see %.2f px from where they are found",
        *(len(found.points), found.mean_reprojection_error_px),
    )
    found = found.of_size(np.full((len(found.names), 2), photo_scale))
    return {
        "mean_reprojection_error_px": found.mean_reprojection_error_px,
        "points": len(found.points),
        "points_in_3_views": found.points_in_3_views,
        "reprojection_errors_px": errors_of(found),
    }


def errors_of(model):
    """{view: mean reprojection error in px}; None of a view that sees no point."""
    return {
        name: None if np.isnan(error) else round(float(error), 4)
        for name, error in zip(model.names, model.errors_px, strict=True)
    }


def describe_photos(model, taken):
    """The part of the report about photos: how they lie, their lenses, their errors."""
    place = {name: i for i, name in enumerate(taken.names)}
    turns = {name: taken.lays[place[name]].turns for name in model.names}
    lenses = {}
    for i, number in enumerate(model.camera_of):
        lens = {"focal_px": [float(model.camtopix[i][k, k]) for k in (0, 1)]}
        lens |= {"centre_px": model.camtopix[i][:2, 2].tolist()}
        lens |= {"distortion": model.distortion[i].tolist()}
        lenses.setdefault(number, lens | {"views": 0})["views"] += 1
    focals = [taken.camera(k).focal_px for k in range(taken.cameras.max() + 1)]
    return {
        "camera_model": model.camera_model,
        "cameras": list(lenses.values()),
        "exif_focal_px": focals[0] if len(focals) == 1 else None,
        # Clockwise, until a view stands upright; the others do.
        "quarter_turns": {name: turn for name, turn in turns.items() if turn},
        "reprojection_errors_px": errors_of(model),
    }


def check_registered(model, least, where):
    """ValueError where too few photos are in the largest model."""
    count = len(model.names) + len(model.left_out)
    if len(model.names) < least * count:
        others = ", ".join(map(str, model.models[1:]))
        apart = f"; others are in models of {others}: two scenes?" if others else ""
        raise ValueError(
            f"{where}: COLMAP registered {len(model.names)} of {count} photos together"
            f"{apart}. Take more photos that overlap, sort out those of other places, "
            "or lower colmap.least_registered"
        )


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
    (scale, rotation, translation), (points, colours) = similarity, views.points
    views = views._replace(
        camtoworlds=cameras.apply_similarity(views.camtoworlds, *similarity),
        points=(scale * points @ rotation.T + translation, colours),
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
    """The part of the report about source, sizes, focal length and split."""
    camtopix = np.linalg.inv(views.pixtocams)
    return {
        "source": config["source"],
        "poses": config["poses"],
        "width": views.width,
        "height": views.height,
        "photo_width": photo_size[0],
        "photo_height": photo_size[1],
        "downscale": config["downscale"],
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
            if (out / name).is_dir():
                shutil.rmtree(out / name)
            else:
                (out / name).unlink()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--config", required=True, help="JSON, or a file of it")
    parser.add_argument("--out", required=True, type=Path, help="results/SCENE")
    options = parser.parse_args()
    faults.run(lambda: main(jobs.read(options.config), options.out))
