"""Polycam's raw data: keyframes/{images,cameras} and, optimised, corrected_*.

`cameras/<time>.json` has fx, fy, cx, cy, width, height and the rows t_00 to t_23 of
ARKit's camera-to-world, of `images/<time>.jpg`: poses of the phone itself.
`corrected_cameras` and `corrected_images` are there where Polycam has optimised poses
and undone the lens's distortion; they are taken then. Undistorted photos have black
borders, so 15 px are cut off all round, as nerfstudio does. `depth` is not read.
Formats: PolyCam/polyform, README.md.
"""

import itertools
import logging
from pathlib import Path

import numpy as np

from alignerf.files import faults, json_files
from alignerf.scenes.apps import phone

log = logging.getLogger(__name__)

CORRECTED = ("corrected_images", "corrected_cameras")
RAW = ("images", "cameras")
CROP_PX = 15
LENS, SIZE = ("fx", "fy", "cx", "cy"), ("width", "height")
ROWS = [[f"t_{row}{column}" for column in range(4)] for row in range(3)]
KINDS = dict.fromkeys([*LENS, *SIZE, *itertools.chain(*ROWS)], json_files.NUMBER)
ALONE = "COLMAP can take the photos alone: give {} as the folder"


def keyframes_of(folder):
    """The folder `keyframes` of a capture, or the folder itself where it is that."""
    inner = Path(folder) / "keyframes"
    return inner if inner.is_dir() else Path(folder)


def is_like(folder):
    """Whether a folder is meant to be Polycam's, complete or not."""
    folder = Path(folder)
    if (inner := folder / "keyframes").is_dir():
        return any((inner / name).is_dir() for name in (*CORRECTED, *RAW))
    if any((folder / name).is_dir() for name in CORRECTED):
        return True
    # Other programs have folders of these two names, too.
    photos, cameras = (folder / name for name in RAW)
    return photos.is_dir() and any(cameras.glob("[0-9]*.json"))


def is_optimised(folder):
    """Whether Polycam has optimised the poses, and undistorted the photos."""
    inner = keyframes_of(folder)
    photos, cameras = (inner / name for name in CORRECTED)
    return photos.is_dir() and any(cameras.glob("*.json"))


def photos_of(folder):
    """{view name: path} of the photos; ValueError where there are none."""
    inner, (name, _) = keyframes_of(folder), kinds_of(folder)
    if not (inner / name).is_dir():
        raise ValueError(f"{inner}: no {name}: the photos of Polycam's raw data")
    found = phone.photos_in(inner / name)
    if not found:
        raise ValueError(f"{inner / name}: no photos")
    return found


def check(folder):
    """ValueError naming what a folder that is meant to be Polycam's lacks."""
    inner, (photos, cameras) = keyframes_of(folder), kinds_of(folder)
    photos_of(folder)
    if not any((inner / cameras).glob("*.json")):
        raise ValueError(
            f"{inner}: no {cameras} beside {photos}: export Polycam's raw data again "
            "with developer mode on. " + ALONE.format(inner / photos)
        )


def kinds_of(folder):
    """Names of the folders of photos and of cameras that are read."""
    return CORRECTED if is_optimised(folder) else RAW


def read(folder):
    """(prepare.PosedViews, names of the photos without a camera).

    Raises ValueError with one line that names the file and the key.
    """
    check(folder)
    inner, (_, cameras) = keyframes_of(folder), kinds_of(folder)
    shots, left_out = [], []
    for name, photo in photos_of(folder).items():
        path = inner / cameras / f"{name}.json"
        if path.is_file():
            shots.append(shot_of(name, photo, path))
        else:
            left_out.append(name)
    if not shots:
        raise ValueError(f"{inner / cameras}: no <photo>.json of any photo")
    if left_out:
        log.warning("%s: no camera of %s", inner, faults.some_names(left_out))
    phone.check_apart(shots, inner / cameras)
    crop_px = CROP_PX if is_optimised(folder) else 0
    return phone.views_of(shots, inner, crop_px=crop_px), left_out


def shot_of(name, photo, path):
    """The Shot of a camera's file."""
    content = json_files.read(path, KINDS)
    matrix = np.array([[content[key] for key in row] for row in ROWS], float)
    values = [content[key] for key in LENS]
    if not all(map(phone.is_number, [*values, *matrix.ravel().tolist()])):
        raise ValueError(f"{path}: a number is too large")
    return phone.Shot(
        name=name,
        photo=photo,
        camtopix=phone.pinhole(path, values, where="its camera"),
        size=tuple(float(content[key]) for key in SIZE),
        camtoworld=phone.pose(matrix, where=f"{path}: t_00 to t_22"),
    )
