"""What the readers of apps share: shots with their cameras, and checked numbers."""

import itertools
import logging
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.io import faults
from alignerf.scenes import distortion, photos, prepare

log = logging.getLogger(__name__)

# Of any number in a file.
LARGEST = 1e12
# How far a quaternion may be from length 1.
LENGTH_ERROR = 1e-2


class Shot(NamedTuple):
    """A photo with the camera that an app has written for it."""

    name: str
    photo: Path
    camtopix: np.ndarray
    """[3, 3], pixel centres at +0.5, of a photo of `size`."""
    size: tuple[float, float] | None
    """(width, height); None where the file does not say, so it is the photo's."""
    camtoworld: np.ndarray
    """[3, 4], OpenGL axes."""


def views_of(shots, where, *, crop_px=0) -> prepare.PosedViews:
    """The views of shots, at the size of their photos less `crop_px` at each border.

    Photos are taken as stored, as the apps' cameras mean them. They have no distortion
    to undo. where: the folder, named in a ValueError for photos that are broken or of
    different sizes.
    """
    names = [shot.name for shot in shots]
    size = photos.stored_size(names, [shot.photo for shot in shots], where)
    width, height = (side - 2 * crop_px for side in size)
    if min(width, height) < prepare.MIN_SIZE_PX:
        raise ValueError(f"{where}: photos of {size[0]}x{size[1]} are too small")
    moved = np.array([[1.0, 0, -crop_px], [0, 1, -crop_px], [0, 0, 1]])
    lenses = []
    for shot in shots:
        scale = prepare.true_scale(shot.size or size, size, where=shot.photo)
        lenses.append((moved @ scale @ shot.camtopix, np.zeros(5)))

    def cropped(image):
        return np.ascontiguousarray(image[crop_px:-crop_px, crop_px:-crop_px])

    steps = (photos.as_stored, cropped) if crop_px else (photos.as_stored,)
    return distortion.pinhole_views(
        names,
        lenses,
        np.stack([shot.camtoworld for shot in shots]),
        width=width,
        height=height,
        photos=[prepare.Photo(shot.photo, steps) for shot in shots],
        where=where,
    )


def photos_in(folder, pattern="*"):
    """{stem: path} of the photos of a folder; ValueError for two of one stem."""
    visible = [p for p in Path(folder).glob(pattern) if not p.name.startswith(".")]
    named = [p for p in visible if p.suffix.lower() in photos.SUFFIXES]
    if gone := sorted(path.name for path in named if not path.is_file()):
        log.warning("%s: ignored %s: no files", folder, faults.some_names(gone))
    paths = sorted((p for p in named if p.is_file()), key=lambda path: path.stem)
    photos.check_names(paths, folder)
    return {path.stem: path for path in paths}


def numbers(path, values, what, count):
    """[count] float64 of a value of an object that was read from `path`.

    what: its name in the ValueError for anything but so many numbers, all of them
    finite.
    """
    fits = isinstance(values, list) and len(values) == count
    if not fits or not all(map(is_number, values)):
        raise ValueError(f"{path}: {what} must be a list of {count} numbers")
    return np.array(values, dtype=np.float64)


def is_number(value):
    """Whether a value of a JSON is a finite number of a sensible size."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < LARGEST


def pinhole(path, values, *, where, centre_px=0.0):
    """Intrinsics [3, 3] of (fx, fy, cx, cy) in px.

    centre_px: added to the principal point. Raises ValueError naming the file and
    `where` for a focal length that is not positive.
    """
    fx, fy, cx, cy = map(float, values)
    if min(fx, fy) <= 0:
        raise ValueError(f"{path}: the focal length of {where} is not positive")
    return np.array([[fx, 0, cx + centre_px], [0, fy, cy + centre_px], [0, 0, 1]])


def pose(matrix, *, where):
    """Camera-to-world [3, 4] of a printed one; ValueError where it is no rotation."""
    matrix = np.array(matrix, np.float64)
    rotation = prepare.nearest_rotation(matrix[:3, :3], where=where)
    return np.concatenate([rotation, matrix[:3, 3:]], axis=-1)


def rotation_of(quaternion, *, where):
    """Rotation [3, 3] of (x, y, z, w); ValueError where its length is not 1."""
    length = np.linalg.norm(quaternion)
    if not abs(length - 1) < LENGTH_ERROR:
        raise ValueError(f"{where} is not a rotation: its length is {length:g}")
    x, y, z, w = quaternion / length
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * (w * across + across @ across)


def check_apart(shots, where):
    """ValueError where a phone has not tracked itself: all poses are one."""
    poses = [shot.camtoworld for shot in shots]
    if len(poses) > 1 and all(
        np.array_equal(a, b) for a, b in itertools.pairwise(poses)
    ):
        raise ValueError(
            f"{where}: all {len(poses)} poses are the same: the phone did not track "
            "itself, as with the front camera"
        )
