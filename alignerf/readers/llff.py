"""Scenes of LLFF (Mildenhall et al. 2019, arXiv 1905.00889): poses_bounds.npy.

One row of 17 numbers a photo, photos in the order of their file names: [3, 5] of
camera-to-world rotation, position and (height, width, focal length) in px of the
photo that COLMAP saw, then the nearest and farthest depth. Axes of the rotation are
down, right and backwards. The depths are kept for exports; the contraction needs none.

The rows say nothing of the lens, yet their poses are COLMAP's for a distorted photo:
the principal point and the distortion come from `sparse/0/cameras.bin`. Without that
file the centre and no distortion are taken, with a warning. EXIF's orientation is not
applied: COLMAP did not see it either.
"""

import logging
from pathlib import Path

import numpy as np

from alignerf.io import archives
from alignerf.readers import colmap_models, shots
from alignerf.scenes import photos, prepare

log = logging.getLogger(__name__)

NUMBERS = 17
# OpenGL axes (right, up, backwards) in LLFF's (down, right, backwards).
LLFF_FROM_OPENGL = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
# Both files print the focal length of one model in full: others differ by more.
SAME_FOCAL = 1e-3


def read(folder, chosen=None, masks=None) -> prepare.PosedViews:
    """Posed, undistorted views of a folder with poses_bounds.npy and photos.

    chosen: the folder of photos; None for `images`, else the images_<n> of least n.
    masks: as of `ingest.find_masks`. Raises ValueError with one line that names the
    file, and the row or photo.
    """
    folder = Path(folder)
    path = folder / "poses_bounds.npy"
    rows, bounds = _read_rows(path)
    chosen = chosen or images_of(folder)
    # By the whole file name, as LLFF sorts: stems alone put a before a-1.
    images = sorted(photos.find_images(chosen).items(), key=lambda one: one[1].name)
    if len(images) != len(rows):
        raise ValueError(
            f"{path} has {len(rows)} rows, but {chosen} {len(images)} images"
        )
    model, found = folder / "sparse" / "0" / "cameras.bin", []
    camera = _read_camera(model) if model.is_file() else None
    if camera is None:
        log.warning("%s not found: no lens distortion is undone", model)
    for i, ((name, photo), row) in enumerate(zip(images, rows, strict=True)):
        height, width, focal = row[:, 4]
        where, size = f"{path}: row {i} ({name})", (width, height)
        if camera:
            _check_same_camera(size, focal, camera, where, model)
        lens = shots.lens(where, "SIMPLE_PINHOLE", [focal, width / 2, height / 2])
        pose = np.concatenate([row[:, :3] @ LLFF_FROM_OPENGL, row[:, 3:4]], axis=-1)
        lens, size = camera or (lens, size)
        found.append(shots.Shot(name, lens, pose, size, photo=photo))
    own = shots.cameras(path, found)._replace(where=model)
    return shots.views_of(own, masks=masks)._replace(bounds=bounds)


def _read_rows(path):
    """[n, 3, 5] rotation, position and (height, width, focal_px) of each row.

    And [n, 2] its nearest and farthest depth.
    """
    rows = archives.read_numbers(path)
    if rows.ndim != 2 or rows.shape[1] != NUMBERS or not len(rows):
        raise ValueError(f"{path}: shape {rows.shape} instead of (n, {NUMBERS})")
    rows, bounds = np.split(rows.astype(np.float64), [15], axis=1)
    if not np.isfinite(rows).all():
        row = np.flatnonzero(~np.isfinite(rows).all(axis=1))[0]
        raise ValueError(f"{path}: row {row} is not finite")
    rows = rows.reshape(-1, 3, 5)
    if not (rows[:, :, 4] > 0).all():
        row = np.flatnonzero((rows[:, :, 4] <= 0).any(axis=1))[0]
        raise ValueError(
            f"{path}: height, width and focal length of row {row} must be positive"
        )
    return rows, bounds


def images_of(folder):
    """The folder of the photos of the largest size there is."""
    places = [folder / "images", *shots.smaller_of(folder)]
    chosen = next(filter(Path.is_dir, places), None)
    if chosen is None:
        raise ValueError(f"{folder}: neither a folder images nor an images_<n>")
    log.info("%s: photos from %s", folder, chosen.name)
    return chosen


def _read_camera(path):
    """(lens, (width, height)) of the one COLMAP camera."""
    lenses = colmap_models.binary_lenses(path)
    if len(lenses) != 1:
        count = len(lenses)
        raise ValueError(f"{path}: {count} cameras, but poses_bounds.npy means one")
    return next(iter(lenses.values()))


def _check_same_camera(size, focal_px, camera, where, path):
    """ValueError unless a row's size and focal length are of the camera in `path`."""
    lens, (width, height) = camera
    prepare.true_scale((width, height), size, where=f"{path}: {where}")
    expected = lens[0][0, 0] * size[0] / width
    if not abs(focal_px - expected) <= SAME_FOCAL * expected:
        raise ValueError(
            f"{where}: focal length {focal_px:g} px, but {expected:g} in {path}"
        )
