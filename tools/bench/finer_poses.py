"""Pose error of COLMAP's own cameras, before and after a second adjustment.

    python -m tools.bench.finer_poses WORK --out docs/measured/finer_poses.csv

Captures whose true cameras are known: the courtyard with objects that move and without,
castle_P30 at three sizes. COLMAP poses their photos from nothing; models are kept in
WORK. The error is that of `pose_error.distance_px` at points of the model.
Data: in the folder that ALIGNERF_DATA names (default ../shared/data).
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
import pycolmap

from alignerf.captures import base
from alignerf.experiment.checks import scenes as of_scenes
from alignerf.io import archives
from alignerf.keypoints import refine
from alignerf.scenes import colmap, prepare
from alignerf.scenes.capture import ingest
from alignerf.sfm import calibration, pose_error
from tools.bench import adjusted, surveyed

CASTLE_SIZES = (1, 2, 4)
MIN_POINTS = 8


def captures(data, work):
    """{name: (the scene's keys, downscale, COLMAP's camera model)}."""
    castle = work / "castle_P30"
    if not castle.is_dir():
        surveyed.main([str(Path(data) / "scenes" / "castle_P30"), str(castle)])
    true = {"source": "courtyard", "poses": "truth"}
    still = true | {"courtyard": {"motion": "none"}}
    given = {"source": "transforms", "path": str(castle)}
    return (
        {
            f"courtyard_{seed}": (true | {"seed": seed}, 1, "SIMPLE_PINHOLE")
            for seed in range(3)
        }
        | {
            f"still_{seed}": (still | {"seed": seed}, 1, "SIMPLE_PINHOLE")
            for seed in range(2)
        }
        | {f"castle_{size}": (given, size, "OPENCV") for size in CASTLE_SIZES}
    )


def make(folder, scene, downscale, camera_model):
    """Write photos, true cameras and COLMAP's model of a capture."""
    folder.mkdir(parents=True, exist_ok=True)
    config = of_scenes.checked(scene)
    scratch = Path(tempfile.mkdtemp(dir=folder))
    views, *_ = base.of(config).read(config, scratch)
    views = prepare.downscale(prepare.sort_by_name(views), downscale)
    prepare.write_photos(folder / "images", views)
    size = views.width, views.height
    camera = ingest.Camera(views.names, size, size, None)
    (folder / "work").mkdir()
    options = {"camera_model": camera_model, "seed": 0}
    found = colmap.estimate_poses(
        folder / "images", folder / "work", [camera], **options
    )
    (folder / "model").mkdir()
    found.of_colmap.write(folder / "model")
    np.savez(
        folder / "true.npz",
        names=np.array(views.names),
        camtopix=np.linalg.inv(views.pixtocams),
        camtoworlds=views.camtoworlds,
    )


def cameras_of(model):
    """(names, `calibration.Cameras`) of COLMAP's model, sorted by image."""
    images = [image for _, image in sorted(model.images.items())]
    lenses = [colmap.lens(i.camera.model.name, i.camera.params) for i in images]
    camtopix, distortion = map(np.stack, zip(*lenses, strict=True))
    poses = np.stack([colmap.pose_of(image) for image in images])
    names = [image.name.removesuffix(".png") for image in images]
    return names, calibration.Cameras(camtopix, poses, distortion)


def errors_px(model, folder):
    """[n] pose error of each view."""
    keys = ["names", "camtopix", "camtoworlds"]
    arrays, (names, now) = archives.read(folder / "true.npz", keys), cameras_of(model)
    at = [arrays["names"].tolist().index(name) for name in names]
    none = np.zeros((len(at), 5))
    true = calibration.Cameras(arrays["camtopix"][at], arrays["camtoworlds"][at], none)
    points = {}
    for view, number in enumerate(sorted(model.images)):
        seen = [
            model.points3D[point.point3D_id].xyz
            for point in model.images[number].points2D
            if point.has_point3D()
        ]
        if len(seen) >= MIN_POINTS:
            points[view] = np.array(seen)[:: max(1, len(seen) // 300)]
    found = pose_error.distance_px(true, now, points)
    return np.array([found[view] for view in sorted(found)])


def row_of(name, folder):
    model = pycolmap.Reconstruction(folder / "model")
    started = time.monotonic()
    now, told = refine.refine(model, free="lens", more=("centre",), seed=0)
    seconds = time.monotonic() - started
    before, after = (errors_px(one, folder) for one in (model, now))
    return {
        "capture": name,
        "width": next(iter(model.cameras.values())).width,
        "views": len(before),
        "tracks": told["tracks"],
        "refined": told.get("refined"),
        "accepted": told["accepted"],
        "gain_in_errors": round(told["gain"][0] / told["gain"][1], 1),
        "colmap_px": round(float(np.median(before)), 3),
        "again_px": round(float(np.median(after)), 3),
        "left": round(float(np.median(after) / np.median(before)), 2),
        "colmap_worst_px": round(float(before.max()), 2),
        "again_worst_px": round(float(after.max()), 2),
        "views_worse": int((after > before + 0.02).sum()),
        "time_s": round(seconds),
    }


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("work", type=Path)
    parser.add_argument("--data", default=adjusted.data_folder())
    parser.add_argument("--captures", nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args(argv)
    every = captures(args.data, args.work)
    adjusted.write_rows(args.out, rows_of(args.captures or every, every, args.work))


def rows_of(names, every, work):
    for name in names:
        folder = work / name
        if not (folder / "true.npz").is_file():
            make(folder, *every[name])
        yield row_of(name, folder)


if __name__ == "__main__":
    main()
