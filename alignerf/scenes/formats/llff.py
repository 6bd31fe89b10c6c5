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
import struct
from pathlib import Path

import numpy as np
import pycolmap

from alignerf.io import archives, faults
from alignerf.scenes import cameras as scene_cameras
from alignerf.scenes import colmap, photos, prepare
from alignerf.scenes.formats import shots

log = logging.getLogger(__name__)

NUMBERS = 17
# OpenGL axes (right, up, backwards) in LLFF's (down, right, backwards).
LLFF_FROM_OPENGL = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
# Both files print the focal length of one model in full: others differ by more.
SAME_FOCAL = 1e-3
# Of a file of one camera.
MAX_BYTES = 2**20


def read(folder, chosen=None, masks=None) -> prepare.PosedViews:
    """Posed, undistorted views of a folder with poses_bounds.npy and photos.

    chosen: the folder of photos; None for `images`, else the images_<n> of least n.
    masks: as of `ingest.find_masks`. Raises ValueError with one line that names the
    file, and the row or photo.
    """
    folder = Path(folder)
    path = folder / "poses_bounds.npy"
    rows, bounds = _read_rows(path)
    images = _find_photos(chosen or images_of(folder))
    if len(images) != len(rows):
        raise ValueError(
            f"{path} has {len(rows)} rows, but "
            f"{next(iter(images.values())).parent} {len(images)} images"
        )
    where = [f"{path}: row {i} ({name})" for i, name in enumerate(images)]
    cameras_bin = folder / "sparse" / "0" / "cameras.bin"
    cameras = _cameras(cameras_bin, rows[:, :, 4], where)
    turns = rows[:, :, :3] @ LLFF_FROM_OPENGL
    poses = np.concatenate([turns, rows[:, :, 3:4]], axis=-1)
    poses = scene_cameras.nearest_rotations(path, list(images), poses)
    own = [
        shots.Shot(name, image, camtopix, size, pose, coefficients)
        for (name, image), (camtopix, coefficients, size), pose in zip(
            images.items(), cameras, poses, strict=True
        )
    ]
    return shots.views_of(own, cameras_bin, masks=masks)._replace(bounds=bounds)


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
    chosen = folder / "images"
    if not chosen.is_dir():
        smaller = {
            int(number): path
            for path in folder.glob("images_*")
            if path.is_dir()
            and (number := path.name.removeprefix("images_")).isdecimal()
        }
        if not smaller:
            raise ValueError(f"{folder}: neither a folder images nor an images_<n>")
        chosen = smaller[min(smaller)]
    log.info("%s: photos from %s", folder, chosen.name)
    return chosen


def _find_photos(chosen):
    """{view: path} of the photos in the order of the rows."""
    # By the whole file name, as LLFF sorts: stems alone put a before a-1.
    found = photos.find_images(chosen)
    return dict(sorted(found.items(), key=lambda item: item[1].name))


def _cameras(cameras_bin, sizes_and_focals, where):
    """(camtopix, distortion, (width, height)) of each row [h, w, focal_px]."""
    if cameras_bin.is_file():
        camera = _read_camera(cameras_bin)
        _check_same_camera(sizes_and_focals, camera, where, cameras_bin)
        return [camera] * len(sizes_and_focals)
    log.warning("%s not found: no lens distortion is undone", cameras_bin)
    return [
        (np.array([[f, 0, w / 2], [0, f, h / 2], [0, 0, 1]]), np.zeros(5), (w, h))
        for h, w, f in sizes_and_focals
    ]


def _read_camera(path):
    """(camtopix [3, 3], distortion [5], (width, height)) of the one COLMAP camera."""
    content = faults.content(path, MAX_BYTES)
    try:
        (count,) = struct.unpack_from("<Q", content)
        if count != 1:
            raise ValueError(f"{count} cameras, but poses_bounds.npy means one")
        _, model, width, height = struct.unpack_from("<iiQQ", content, 8)
        params = np.frombuffer(content, "<f8", offset=32)
        known = {
            int(one): name for name, one in pycolmap.CameraModelId.__members__.items()
        }
        lens = colmap.lens(known.get(model, f"number {model}"), params)
    except (struct.error, ValueError) as error:
        raise ValueError(f"{path}: {error}") from None
    return *lens, (width, height)


def _check_same_camera(sizes_and_focals, camera, where, path):
    """Raise ValueError unless each row [h, w, focal_px] is of the camera in `path`."""
    camtopix, _, (width, height) = camera
    for (h, w, focal_px), place in zip(sizes_and_focals, where, strict=True):
        prepare.true_scale((width, height), (w, h), where=f"{path}: {place}")
        expected = camtopix[0, 0] * w / width
        if not abs(focal_px - expected) <= SAME_FOCAL * expected:
            raise ValueError(
                f"{place}: focal length {focal_px:g} px, but {expected:g} in {path}"
            )
