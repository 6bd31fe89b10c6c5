"""Views of captures at their photos' own size: posed by COLMAP, or read once more.

What `alignerf.poses` found is taken from the scene's folder, so COLMAP does not run a
second time: the lenses from `prepared.LENSES`, the cameras from cameras.npz or from
another file of the same views.
"""

from pathlib import Path

import numpy as np

from alignerf.captures import base
from alignerf.colmap import canvas, ingest, structure
from alignerf.io import archives, faults
from alignerf.scenes import cameras, distortion, prepare, prepared

OF_LENS = ("camtopix", "distortion")
OF_LENSES = ("names", "camtopix", "distortion", "camera_of")


def by_colmap(folder, scratch, config, *, camera_model="OPENCV", where=None):
    """(views at full size, the report so far, no truth) of photos posed by COLMAP."""
    views, model, taken = structure.pose_folder(
        folder,
        scratch,
        camera_model=config.colmap.camera_model or camera_model,
        max_size_px=config.colmap.max_size_px,
        seed=config.seed,
        where=where or str(folder),
        background=config.background,
        masks=config.masks,
        adjust_again=config.adjust_again,
    )
    least = config.colmap.min_registered
    check_registered(model, least, where or folder)
    told = registration(model.names, model.left_out)
    error_px, errors_px = model.mean_reprojection_error_px, model.errors_px
    told |= told_of_points(model.names, len(model.points), error_px, errors_px)
    told |= told_of_photos(model, taken)
    return views, told | {"models": model.models, "again": model.again}, None


def read(config, folder, work_folder, cameras_path=None) -> prepare.PosedViews:
    """The views of a prepared scene at the size of its photos, in its own order.

    config: the scene's keys, complete. folder: its folder of results. work_folder:
    existing; files that the photos are read from may be written there. cameras_path:
    another cameras.npz of the same views. Photos are read when they are needed, and
    undistorted then. Raises ValueError where the photos are not those that the scene
    was made of.
    """
    folder = Path(folder)
    arrays = prepared.read_cameras(cameras_path or folder / "cameras.npz")
    views = base.of(config).at_full_size(config, folder, Path(work_folder))
    place = {name: i for i, name in enumerate(views.names)}
    names = arrays["names"].tolist()
    if gone := [name for name in names if name not in place]:
        where = config.path or config.source
        raise ValueError(f"{where}: the photo of view {faults.shown(gone[0])} is gone")
    views = prepare.select(views, [place[name] for name in names])
    if (folder / prepared.LENS).is_file():
        views = relensed(views, archives.read(folder / prepared.LENS, OF_LENS))
    across = views.width / arrays["width"], views.height / arrays["height"]
    if not np.allclose(*across, rtol=prepare.SAME_SHAPE - 1):
        raise ValueError(
            f"{config.path}: photos of {views.width}x{views.height} are no longer "
            f"those that {folder / 'cameras.npz'} was made of"
        )
    return views._replace(
        pixtocams=cameras.rescale_intrinsics(arrays["pixtocams"], *across),
        camtoworlds=arrays["camtoworlds"],
        points=points_of(folder),
        bounds=None,
        split=arrays["split"],
    )


def relensed(views, lens):
    """The views with the distortion undone that adjusting has found."""
    return distortion.pinhole_views(
        views.names,
        list(zip(lens["camtopix"], lens["distortion"], strict=True)),
        views.camtoworlds,
        width=views.width,
        height=views.height,
        photos=views.photos,
        masks=views.masks,
        where=prepared.LENS,
    )


def points_of(folder):
    """The points and colours of a prepared scene, or None."""
    path = folder / prepared.POINTS
    if not path.is_file():
        return None
    arrays = archives.read(path, ["points", "colours"])
    return arrays["points"], arrays["colours"]


def once_more(photos, config, folder, work_folder):
    """A folder of photos that COLMAP posed, undistorted by the lenses that it found."""
    path = folder / prepared.LENSES
    lenses = archives.read(path, OF_LENSES)
    taken = ingest.once_more(
        photos,
        work_folder,
        background=config.background,
        masks=config.masks,
    )
    place = {name: i for i, name in enumerate(taken.names)}
    names = lenses["names"].tolist()
    if gone := [name for name in names if name not in place]:
        raise ValueError(f"{photos}: the photo {faults.shown(gone[0])} is gone")
    kept = [place[name] for name in names]
    return canvas.views_of(
        names,
        list(zip(lenses["camtopix"], lenses["distortion"], strict=True)),
        [taken.sizes[i] for i in kept],
        np.tile(np.eye(4)[:3], (len(kept), 1, 1)),
        camera_of=lenses["camera_of"].tolist(),
        photos=[prepare.Photo(i, (taken.load,)) for i in kept],
        masks=config.masks and [prepare.Photo(i, (taken.load_mask,)) for i in kept],
        where=photos,
    )


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


def told_of_points(names, count, error_px, errors_px):
    """The part about points: how many, the mean reprojection error, that of each view.

    That of a view that sees none is NaN, and null in the report.
    """
    each = zip(names, errors_px, strict=True)
    return {
        "mean_reprojection_error_px": error_px,
        "points": count,
        "reprojection_errors_px": {
            name: None if np.isnan(px) else round(float(px), 4) for name, px in each
        },
    }


def told_of_photos(model, taken):
    """The part about photos: how they lie, and their lenses."""
    place = {name: i for i, name in enumerate(taken.names)}
    turns = {name: taken.lays[place[name]].turns for name in model.names}
    lenses = {}
    for i, number in enumerate(model.camera_of):
        lens = {"focal_px": [float(model.camtopix[i][k, k]) for k in (0, 1)]}
        lens |= {"centre_px": model.camtopix[i][:2, 2].tolist()}
        lens |= {"distortion": model.distortion[i].tolist()}
        lenses.setdefault(number, lens | {"views": 0})["views"] += 1
    return {
        "camera_model": model.camera_model,
        "cameras": list(lenses.values()),
        # Clockwise, until a view stands upright; the others do.
        "quarter_turns": {name: turn for name, turn in turns.items() if turn},
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
            "or lower colmap.min_registered"
        )
