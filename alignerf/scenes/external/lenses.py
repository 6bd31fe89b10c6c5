"""The cameras that another program's renders were seen by.

Read are: a transforms.json (instant-ngp, nerfstudio), a COLMAP model (sparse/0, binary
or text), what `scenes.programs` reads, such as the cameras.json of 3D Gaussian
splatting, and nothing at all: then a field of view is assumed, and only turns and zooms
can be told.
"""

import logging
import math
import os
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pycolmap

from alignerf.io import faults, json_files
from alignerf.scenes import cameras, prepare
from alignerf.scenes.formats import colmap_models, transforms
from alignerf.scenes.programs import base as programs
from alignerf.scenes.programs import reading

log = logging.getLogger("alignerf")

# Of a .ply, and of its head.
MAX_PLY_BYTES, HEAD_BYTES = 2**31, 2**16
# The horizontal field of view that is assumed where nothing is known: of a phone's main
# camera. By a wrong one a turn is told wrongly by the same share.
ASSUMED_DEGREES = 65.0
# Written by 3D Gaussian splatting beside its model.
GAUSSIANS = "cameras.json"


# Files of COLMAP's models.
OF_MODEL = ("cameras.", "images.", "points3D.", "rigs.", "frames.")
KNOWN = (
    "transforms.json, COLMAP's sparse/0, or cameras of "
    + ", ".join(module.NAME for module in reading.READERS)
    + " were expected"
)


class Lens(NamedTuple):
    """A view's camera.

    camtopix [3, 3] and distortion, as of `distortion`, are of `size`: (width, height)
    in px; None means the photo's. camtopix is None where nothing is known of it, and
    the photo's size tells a guess. pose: camera-to-world [3, 4], OpenGL axes.
    """

    camtopix: np.ndarray | None
    distortion: np.ndarray
    size: tuple | None
    pose: np.ndarray

    def at(self, size, where):
        """(camtopix, distortion) at a photo's (width, height); ValueError as of
        `prepare.true_scale`."""
        if self.camtopix is None:
            return guessed(size), self.distortion
        own = self.size or size
        return prepare.true_scale(
            own, size, where=where
        ) @ self.camtopix, self.distortion


class Cameras(NamedTuple):
    """{photo: Lens} of a file, what it is, the points and the splits that it has.

    Photos are called as the file calls them; by `of` as views are, {photo: view}:
    `views`. points: positions [m, 3] and colours, or None. splits: {photo: split}, or
    None. applied: nerfstudio's `applied_transform` [4, 4] that is in them, or None.
    """

    lenses: dict
    kind: str
    points: tuple | None = None
    splits: dict | None = None
    applied: np.ndarray | None = None
    views: dict | None = None

    def of(self, views):
        """Those of some photos {name: view}, by view."""
        lenses = {view: self.lenses[name] for name, view in views.items()}
        splits = self.splits and {v: self.splits[name] for name, v in views.items()}
        return self._replace(lenses=lenses, splits=splits, views=views)


def read(path, photo_size) -> Cameras:
    """The cameras of a file or folder; ValueError naming it where there are none.

    photo_size: (width, height) that cameras are of where a transforms.json has no w, h.
    """
    path = Path(path)
    if not path.exists():
        raise ValueError(f"{path}: no such file or folder of cameras")
    if path.is_file():
        if reading.reader_of(path):
            return of_program(path, photo_size)
        if path.suffix != ".json":
            if not path.name.startswith(OF_MODEL):
                raise ValueError(f"{path}: no file of cameras: {KNOWN}")
            return of_model(path.parent)
        return of_json(path, photo_size)
    if (path / "transforms.json").is_file():
        return of_json(path / "transforms.json", photo_size)
    for model, count in (models := colmap_models.by_size(path)).items():
        if len(models) > 1:
            told = f"{count} images is taken, of {len(models)} models"
            log.warning("%s: %s of %s", path, model.relative_to(path), told)
        return of_model(model)
    if found := reading.find(path):
        return of_program(found, photo_size)
    raise ValueError(f"{path}: no cameras in it: {KNOWN}")


def files_of(path):
    """Paths of the files that `read` may take cameras and points from; [] of None."""
    if path is None:
        return []
    path = Path(path)
    if path.is_file() and (path.suffix == ".json" or reading.reader_of(path)):
        return [path, *path.parent.glob("*.ply")]
    folder = path.parent if path.is_file() else path
    found = [folder / "transforms.json", *filter(None, [reading.find(folder)])]
    for model in colmap_models.find(folder):
        for suffix in ("bin", "txt", "ply"):
            found += sorted(model.glob(f"*.{suffix}"))
    return [file for file in found if file.is_file()]


def of_json(path, photo_size) -> Cameras:
    """Those of a transforms.json; the photos that it names need not be there."""
    scene = json_files.read(path, {"frames": list})
    lenses, splits, frames = {}, {}, {}
    # Of nerfstudio's lists; what is validated is held out.
    of_file = {
        name: split
        for split, key in (("test", "val"), ("test", "test"), ("train", "train"))
        for name in transforms.listed(path, scene, key)
    }
    for i, frame in enumerate(scene["frames"]):
        if not isinstance(frame, dict) or not isinstance(frame.get("file_path"), str):
            raise ValueError(f"{path}: frame {i} has no text under 'file_path'")
        name = frame["file_path"]
        if name in frames:
            transforms.check_same(path, frames[name], frame)
            continue
        frames[name] = frame
        usual = dict(zip(("w", "h"), photo_size, strict=True))
        values = usual | scene | frame
        where = transforms.told(frame)
        size = tuple(transforms.number(path, values, k, where=where) for k in "wh")
        lens = transforms.lens(path, values, where=where)
        lenses[name] = Lens(*lens, size, transforms.pose(path, frame))
        if split := of_file.get(frame["file_path"]):
            splits[name] = split
    if not lenses:
        raise ValueError(f"{path}: 'frames' must be a list that is not empty")
    if len(splits) < len(lenses):
        splits = None
    applied = prepare.matrix_of(scene.get("applied_transform"), (3, 4))
    if applied is not None:
        applied = np.vstack([applied, [0, 0, 0, 1]])
        applied = applied if abs(np.linalg.det(applied)) > 1e-12 else None
    points = points_of(path, scene)
    lenses = with_rotations(path, lenses)
    return Cameras(lenses, "transforms.json", points, splits, applied)


def points_of(path, scene):
    """The points that a transforms.json names under `ply_file_path`, or None.

    A file that is missing or none is left out with a warning: cameras do without.
    """
    name = scene.get("ply_file_path")
    if name is None:
        return None
    if not isinstance(name, str):
        raise ValueError(f"{path}: 'ply_file_path' must be a path")
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


def of_model(path) -> Cameras:
    """Those of a COLMAP model, with its points."""
    views, points = colmap_models.read(path)
    lenses = {
        name: Lens(camtopix, distortion, size, pose)
        for name, (camtopix, size, pose, distortion) in views.items()
    }
    return Cameras(lenses, "COLMAP's model", points)


def of_program(path, photo_size) -> Cameras:
    """Those of a file that another program has exported; photo_size: as of `read`."""
    lenses = {}
    for shot in reading.read(path):
        own = programs.sized(shot, photo_size)
        lenses[shot.name] = Lens(own.camtopix, own.distortion, own.size, own.camtoworld)
    lenses = with_rotations(path, lenses)
    return Cameras(lenses, f"{path.name} of {reading.reader_of(path).NAME}", None)


def with_rotations(path, lenses):
    """The same {photo: Lens}; rotations as of `cameras.nearest_rotations`."""
    poses = np.stack([lens.pose for lens in lenses.values()])
    poses = cameras.nearest_rotations(path, [*lenses], poses)
    each = zip(lenses.items(), poses, strict=True)
    return {name: lens._replace(pose=pose) for (name, lens), pose in each}


def guessed(size):
    """Intrinsics [3, 3] of a photo's (width, height) of which nothing is known."""
    focal_px = 0.5 * max(size) / math.tan(math.radians(ASSUMED_DEGREES) / 2)
    width, height = size
    return np.array([[focal_px, 0, width / 2], [0, focal_px, height / 2], [0, 0, 1]])


def assumed(names) -> Cameras:
    """Cameras of photos of which nothing is known; each stands elsewhere."""
    found = {}
    for i, name in enumerate(names):
        pose = np.eye(4)[:3]
        # Normalising poses needs places that differ.
        pose[:, 3] = [math.cos(i), math.sin(i), i / len(names)]
        found[name] = Lens(None, np.zeros(5), None, pose)
    return Cameras(found, "none")
