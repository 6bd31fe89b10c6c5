"""Poses from photos by structure from motion (pycolmap), the same on every run.

Notation: n registered views, sorted by name; `camtopix` [3, 3] with pixel centres at
+0.5, as COLMAP has them too; `distortion` [5] as in `distortion`; `camtoworlds`
[n, 3, 4] with OpenGL axes, in COLMAP's frame, whose scale is arbitrary.
"""

import logging
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pycolmap
from jaxtyping import Float, UInt8

from alignerf.colmap import canvas, ingest, mapping
from alignerf.io import faults
from alignerf.keypoints import adjustment, readjustment
from alignerf.scenes import cameras, distortion, photos, prepare, prepared

log = logging.getLogger(__name__)


class Reconstruction(NamedTuple):
    """COLMAP's largest model, and the names of the views that it left out."""

    names: list[str]
    left_out: list[str]
    camtopix: Float[np.ndarray, "n 3 3"]
    distortion: Float[np.ndarray, "n 5"]
    camtoworlds: Float[np.ndarray, "n 3 4"]
    mean_reprojection_error_px: float
    points: Float[np.ndarray, "m 3"]
    colours: UInt8[np.ndarray, "m 3"]
    models: list[int]
    """Views in each model found, largest first."""
    errors_px: Float[np.ndarray, " n"]
    """Mean reprojection error of each view's points."""
    camera_of: list[int]
    """Which camera took each view."""
    camera_model: str
    of_colmap: pycolmap.Reconstruction
    """COLMAP's own, of the images that it saw."""
    again: dict | None = None
    """What is told of a second adjustment; None where there was to be none."""

    def of_size(self, scale):
        """The reconstruction of photos resized by `scale` [n, 2]: width, height."""
        each = np.concatenate([scale, np.ones((len(scale), 1))], axis=1)
        times = scale.mean(axis=1)
        error_px = self.mean_reprojection_error_px * float(times.mean())
        return self._replace(
            camtopix=each[:, :, None] * self.camtopix,
            mean_reprojection_error_px=error_px,
            errors_px=self.errors_px * times,
        )


def estimate_poses(
    image_folder,
    work_folder,
    taken_by,
    *,
    camera_model="OPENCV",
    max_size_px=1600,
    masks=None,
    seed=0,
    where="photos",
) -> Reconstruction:
    """Poses and intrinsics of <image_folder>/<name>.png, bit-reproducibly.

    taken_by: an `ingest.Camera` of each camera, of the images here; a focal length that
    is known is where it starts. SIFT on images of at most max_size_px, where `masks`
    (folder of <name>.png.png) are not black; incremental mapping; the largest model is
    kept. Writes into work_folder. Raises ValueError naming `where` when too few views
    register.
    """
    names = sorted(name for camera in taken_by for name in camera.names)
    photos.check_enough(len(names), where)
    models = mapping.models_of(
        image_folder,
        work_folder,
        taken_by,
        camera_model=camera_model,
        max_size_px=max_size_px,
        masks=masks,
        seed=seed,
    )
    models = sorted(models, key=lambda model: -model.num_reg_images())
    registered = models[0].num_reg_images() if models else 0
    if registered < photos.LEAST:
        raise ValueError(
            f"{where}: the photos do not overlap enough: COLMAP registered "
            f"{registered} of {len(names)} images"
        )
    if len(models) > 1:
        log.warning(
            "%s: COLMAP found %d separate models, of %s views: keeping the largest",
            where,
            len(models),
            ", ".join(str(model.num_reg_images()) for model in models),
        )
    return convert(models[0], names, models=[m.num_reg_images() for m in models])


def pose_folder(
    folder,
    work_folder,
    *,
    camera_model,
    max_size_px,
    seed,
    where,
    background=None,
    masks=None,
    adjust_again=False,
):
    """Posed, undistorted views of a folder of photos as they were taken.

    background, masks: as of `ingest.ingest`. Returns prepare.PosedViews, the
    Reconstruction, whose lenses and errors are those of the photos in full, and the
    ingest.Taken. Files that are needed for long lie in work_folder.
    """
    options = {"background": background, "max_side_px": max_size_px, "masks": masks}
    taken = ingest.ingest(folder, work_folder, **options)
    taken_by = [taken.camera(k) for k in range(taken.cameras.max() + 1)]
    if len(taken_by) > 1:
        each = ", ".join(
            f"{len(camera.names)} of {camera.size[0]}x{camera.size[1]}"
            for camera in taken_by
        )
        log.warning("%s: %d cameras: %s", where, len(taken_by), each)
    log.info("COLMAP on %d photos", len(taken.names))
    model = estimate_poses(
        taken.folder,
        work_folder,
        [camera.of_copies() for camera in taken_by],
        camera_model=camera_model,
        max_size_px=max_size_px,
        masks=None if masks is None else Path(work_folder) / "copies_masks",
        seed=seed,
        where=where,
    )
    if adjust_again:
        model = adjusted_again(model, taken, seed)
    place = {name: i for i, name in enumerate(taken.names)}
    kept = [place[name] for name in model.names]
    sizes = [taken.sizes[i] for i in kept]
    copy_sizes = [taken.copy_sizes[i] for i in kept]
    model = model.of_size(np.array(sizes) / np.array(copy_sizes))
    files = {
        name: str(
            path.relative_to(folder) if path.is_relative_to(folder) else path.name
        )
        for name, path in zip(taken.names, taken.paths, strict=True)
    }
    write_model(model, Path(work_folder) / "colmap", sizes, files)
    beside = Path(work_folder) / prepared.BESIDE
    beside.mkdir()
    np.savez(
        beside / "lenses.npz",
        names=np.array(model.names),
        camtopix=model.camtopix,
        distortion=model.distortion,
        camera_of=np.array(model.camera_of),
        sizes=np.array(sizes),
    )
    if model.left_out:
        log.warning("COLMAP left out %s", faults.some_names(model.left_out))
    views = canvas.views_of(
        model.names,
        list(zip(model.camtopix, model.distortion, strict=True)),
        sizes,
        model.camtoworlds,
        camera_of=model.camera_of,
        photos=[prepare.Photo(i, (taken.load,), taken.paths[i]) for i in kept],
        masks=masks
        and [prepare.Photo(i, (taken.load_mask,), taken.masks[i]) for i in kept],
        where=where,
    )
    return views._replace(points=(model.points, model.colours)), model, taken


def adjusted_again(model: Reconstruction, taken: ingest.Taken, seed) -> Reconstruction:
    """The model after a second adjustment, where held-out tracks gain by it."""
    place, own = {name: i for i, name in enumerate(taken.names)}, model.of_colmap
    at = [place[one.name.removesuffix(".png")] for one in own.images.values()]
    times = [max(taken.sizes[i]) / max(taken.copy_sizes[i]) for i in at]
    bends = any(lens(c.model.name, c.params)[1].any() for c in own.cameras.values())
    now, told = readjustment.refine(
        own,
        free="lens" if bends else "focal",
        more=("centre",),
        seed=seed,
        photo_px=float(np.median(times)),
    )
    names = [*model.names, *model.left_out]
    return convert(now, names, models=model.models)._replace(again=told)


def write_model(model: Reconstruction, folder, sizes, files):
    """Write COLMAP's own model, rescaled to photos of these sizes.

    files: name of each view's photo.
    """
    folder.mkdir()
    own, times = model.of_colmap, {}
    for number, size in dict(zip(model.camera_of, sizes, strict=True)).items():
        camera = own.cameras[number]
        times[number] = np.array(size) / [camera.width, camera.height]
        camera.rescale(*size)
    for image in own.images.values():
        image.name = files[image.name.removesuffix(".png")]
        for point in image.points2D:
            point.xy = point.xy * times[image.camera_id]
    own.update_point_3d_errors()
    own.write(folder)


def convert(model, names, *, models=()) -> Reconstruction:
    """A pycolmap reconstruction in our conventions, sorted by view name."""
    posed = {
        image.name.removesuffix(".png"): image
        for image in model.images.values()
        if image.has_pose
    }
    kept = sorted(posed)
    taken_by = [model.cameras[posed[name].camera_id] for name in kept]
    lenses = [lens(camera.model.name, camera.params) for camera in taken_by]
    points = list(model.points3D.values())
    return Reconstruction(
        names=kept,
        left_out=sorted(set(names) - set(kept)),
        camtopix=np.stack([camtopix for camtopix, _ in lenses]),
        distortion=np.stack([distortion for _, distortion in lenses]),
        camtoworlds=np.stack([pose_of(posed[name]) for name in kept]),
        mean_reprojection_error_px=float(model.compute_mean_reprojection_error()),
        points=np.array([point.xyz for point in points]).reshape(-1, 3),
        colours=np.array([point.color for point in points], np.uint8).reshape(-1, 3),
        models=list(models) or [len(kept)],
        errors_px=np.array([error_px(model, posed[name]) for name in kept]),
        camera_of=[posed[name].camera_id for name in kept],
        camera_model=taken_by[0].model.name,
        of_colmap=model,
    )


def error_px(model, image):
    """Mean reprojection error of the points that an image sees; NaN of none."""
    errors = adjustment.errors_px(model, image.image_id)
    seen = errors[np.isfinite(errors)]
    return float(np.mean(seen)) if len(seen) else np.nan


def lens(model, params):
    """(camtopix [3, 3], distortion as in `distortion`) of a COLMAP camera.

    Raises ValueError for another model and a panorama's, and for parameters of another
    number, not finite or without a focal length.
    """
    names = distortion.parameters(model)
    if len(params) != len(names):
        raise ValueError(f"a {model} camera of {len(params)} parameters")
    values = dict(zip(names, map(float, params), strict=True))
    focal = values.pop("f", None)
    fx, fy = (values.pop(name, focal) for name in ("fx", "fy"))
    cx, cy = values.pop("cx"), values.pop("cy")
    if not (np.isfinite(params).all() and min(fx, fy) > 0):
        raise ValueError(f"a {model} camera of parameters {list(params)}")
    camtopix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return camtopix, distortion.of_model(model, values)


def pose_of(image):
    """Camera-to-world [3, 4], OpenGL axes, of a registered pycolmap image."""
    return pose_from(image.cam_from_world())


def pose_from(camera_from_world):
    """Camera-to-world [3, 4], OpenGL axes, of a pycolmap.Rigid3d."""
    world_from_camera = camera_from_world.inverse().matrix()
    rotation = world_from_camera[:, :3] @ cameras.OPENGL_FROM_OPENCV
    return np.concatenate([rotation, world_from_camera[:, 3:]], axis=-1)
