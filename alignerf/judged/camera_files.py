"""The cameras that another program's renders were seen by.

Read are: a transforms.json (instant-ngp, nerfstudio), a COLMAP model (sparse/0, binary
or text), what `readers.programs` read, such as the cameras.json of 3D Gaussian
splatting, and nothing at all: then a field of view is assumed, and only turns and zooms
can be told.
"""

import logging
import math
import os
import re
from pathlib import Path

import numpy as np
import pycolmap

from alignerf.io import faults
from alignerf.readers import colmap_models, shots, transforms
from alignerf.readers.programs import reading

log = logging.getLogger("alignerf")

# Of a .ply, and of its head.
MAX_PLY_BYTES, HEAD_BYTES = 2**31, 2**16
# The horizontal field of view that is assumed where nothing is known: of a phone's main
# camera. By a wrong one a turn is told wrongly by the same share.
ASSUMED_DEGREES = 65.0
# The kind of cameras of which nothing is known.
NONE = "none"
# Written by 3D Gaussian splatting beside its model.
GAUSSIANS = "cameras.json"


# Files of COLMAP's models.
OF_MODEL = ("cameras.", "images.", "points3D.", "rigs.", "frames.")
KNOWN = (
    "transforms.json, COLMAP's sparse/0, or cameras of "
    + ", ".join(module.NAME for module in reading.READERS)
    + " were expected"
)


def read(path) -> shots.Cameras:
    """The cameras of a file or folder, and its points; ValueError where it has none."""
    path = Path(path)
    if not path.exists():
        raise ValueError(f"{path}: no such file or folder of cameras")
    json = path / transforms.NAME if path.is_dir() else path
    if path.is_file() and reading.reader_of(path):
        return reading.cameras_of(path)
    if json.suffix == ".json" and json.is_file():
        own = transforms.cameras_of(json)
        return own._replace(points=points_of(json, own.ply))
    if path.is_file():
        if path.name.startswith(OF_MODEL):
            return colmap_models.cameras_of(path.parent)
        raise ValueError(f"{path}: no file of cameras: {KNOWN}")
    for model in (models := colmap_models.by_size(path)):
        colmap_models.tell_others(path, model, models)
        return colmap_models.cameras_of(model)
    if found := reading.find(path):
        return reading.cameras_of(found)
    raise ValueError(f"{path}: no cameras in it: {KNOWN}")


def files_of(path):
    """Paths of the files that `read` may take cameras and points from; [] of None."""
    if path is None:
        return []
    path = Path(path)
    if path.is_file() and (path.suffix == ".json" or reading.reader_of(path)):
        return [path, *path.parent.glob("*.ply")]
    folder = path.parent if path.is_file() else path
    found = [folder / transforms.NAME, *filter(None, [reading.find(folder)])]
    for model in colmap_models.find(folder):
        for suffix in ("bin", "txt", "ply"):
            found += sorted(model.glob(f"*.{suffix}"))
    return [file for file in found if file.is_file()]


def points_of(path, name):
    """The points of a .ply that a transforms.json names, or None.

    A file that is missing or none is left out with a warning: cameras do without.
    """
    if name is None:
        return None
    place = Path(os.path.normpath(path.parent / name))
    if not place.is_relative_to(os.path.normpath(path.parent)):
        raise ValueError(f"{path}: {faults.shown(name)} leads out of its folder")
    try:
        return read_points(place)
    except (ValueError, OSError) as error:
        log.warning("no points: %s", error)
        return None


def read_points(path):
    """(positions [m, 3] float64, colours [m, 3] uint8) of the vertices of a .ply.

    As nerfstudio and 3D Gaussian splatting begin with; pycolmap reads it. Raises
    ValueError naming the file.
    """
    with faults.opened(path, MAX_PLY_BYTES) as file:
        element = re.search(rb"^element (\S+)", file.read(HEAD_BYTES), re.MULTILINE)
    if element is None or element[1] != b"vertex":
        # The reader would take what comes first for vertices.
        raise ValueError(f"{path}: not a .ply that begins with vertices")
    model = pycolmap.Reconstruction()
    try:
        model.import_PLY(path)
    # Whatever COLMAP's reader finds wrong is the file's fault.
    except Exception as error:
        first = " ".join(str(error).splitlines()[:1])
        raise ValueError(f"{path}: not a readable .ply: {first}") from None
    points = [model.points3D[number] for number in sorted(model.points3D)]
    if not points:
        raise ValueError(f"{path}: a .ply without vertices")
    positions = np.array([point.xyz for point in points])
    colours = np.array([point.color for point in points], np.uint8)
    known = np.isfinite(positions).all(axis=-1)
    return positions[known], colours[known]


def guessed(size):
    """The `Shot.lens` of a photo of which nothing is known."""
    focal_px = 0.5 * max(size) / math.tan(math.radians(ASSUMED_DEGREES) / 2)
    params = [focal_px, size[0] / 2, size[1] / 2]
    return shots.lens("", "SIMPLE_PINHOLE", params)


def assumed(names) -> shots.Cameras:
    """Cameras of photos of which nothing is known; each stands elsewhere."""
    found = []
    for i, name in enumerate(names):
        pose = np.eye(4)[:3]
        # Normalising poses needs places that differ.
        pose[:, 3] = [math.cos(i), math.sin(i), i / len(names)]
        found.append(shots.Shot(name, guessed, pose, is_own=True))
    return shots.cameras("", found, NONE)
