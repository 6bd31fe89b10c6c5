"""Scenes of mip-NeRF 360 as published (`360_v2.zip`), and other COLMAP projects.

A folder has `images` and the same photos made smaller in `images_2`, `images_4` and
`images_8`; `sparse/0` is a COLMAP model of the largest. Others lay the model elsewhere,
write it as text, or have several (`colmap_models`); photos may lie beside the
model's files. Distortion is undone; 360_v2 has none. Smaller photos have rounded sizes,
so that intrinsics are scaled by the true sizes, not by n. Without a model, LLFF's
poses_bounds.npy is read.
"""

import logging
from pathlib import Path

import numpy as np

from alignerf.io import faults
from alignerf.scenes import distortion, photos, prepare
from alignerf.scenes.formats import colmap_models, llff, shots

log = logging.getLogger(__name__)


def read(folder, images=None):
    """(prepare.PosedViews, names of the photos that the model has no pose for).

    images: the n of images_<n>; None for the largest that is there. Raises ValueError
    with one line that names the file or photo.
    """
    folder = Path(folder)
    chosen = images_of(folder, images)
    model = model_of(folder)
    if model is None:
        log.warning("%s/sparse/0 not found: poses of poses_bounds.npy", folder)
        return llff.read(folder, chosen), []
    paths = {path.stem: path for path in photos.find_images(chosen)}
    posed, points = colmap_models.read(model)
    for name in posed:
        if name not in paths:
            named = faults.name_of(name)
            raise ValueError(
                f"{chosen}: no photo {named}, which {model} has a pose for"
            )
    left_out = sorted(set(paths) - set(posed))
    if left_out:
        log.warning("%s: no pose of %s", model, faults.some_names(left_out))
    names = sorted(posed)
    chosen_paths = [paths[name] for name in names]
    width, height = photos.stored_size(names, chosen_paths, chosen)
    lenses = []
    for name in names:
        camtopix, coefficients, size, _ = posed[name]
        scale = prepare.true_scale(size, (width, height), where=paths[name])
        lenses.append((scale @ camtopix, coefficients))
    views = distortion.pinhole_views(
        names,
        lenses,
        np.stack([posed[name][3] for name in names]),
        width=width,
        height=height,
        photos=[prepare.Photo(paths[name], (photos.as_stored,)) for name in names],
        where=model,
    )
    return views._replace(points=points), left_out


def images_of(folder, number):
    """The folder of photos: images_<number>, or the largest that there is.

    Without any of these the folder itself, where it holds photos.
    """
    if number is None:
        named = (folder / "images").is_dir() or any(folder.glob("images_*"))
        if not named and shots.photos_in(folder):
            return folder
        return llff.images_of(folder)
    chosen = folder / ("images" if number == 1 else f"images_{number}")
    if not chosen.is_dir():
        raise ValueError(f"{folder}: no folder {chosen.name}")
    return chosen


def model_of(folder):
    """The path of the model; None where poses_bounds.npy is all that there is.

    Raises ValueError where there is neither.
    """
    model, usual = colmap_models.largest(folder), folder / "sparse" / "0"
    if model is not None or usual.is_dir():
        return model or usual
    if not (folder / "poses_bounds.npy").is_file():
        lacking = colmap_models.missing(folder)
        raise ValueError(lacking or f"{folder}: neither sparse/0 nor poses_bounds.npy")
    return None
