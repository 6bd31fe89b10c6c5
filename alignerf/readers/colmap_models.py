"""COLMAP's models: where they lie in a project, their cameras and points.

In each place (PLACES) a model lies in a folder of its number, or at once. A model is
three files, .bin or .txt. COLMAP writes several where photos do not hang together: they
share no frame, so the one with most images is taken, and the others are named.

They are not read by COLMAP's own reader. It trusts a binary file's counts: on one that
was cut short it takes minutes and 15 GB. Of texts it takes a quaternion of 0 for no
turn, cuts a name at its first space, stops at a byte order mark, and leaves out every
second image of a file without lines of points. Without a file of points it reads
nothing; here cameras do without. An image has its own pose also beside rigs and frames,
which are not read. Formats: COLMAP's src/colmap/scene/reconstruction_io_binary.cc and
reconstruction_io_text.cc.
"""

import contextlib
import logging
import math
import struct
from pathlib import Path

import numpy as np
import pycolmap

from alignerf.io import faults
from alignerf.readers import shots
from alignerf.scenes import distortion

log = logging.getLogger("alignerf")

# Where models lie, the usual ones first: of COLMAP, of nerfstudio, of hand-made
# projects, and of undistorted photos and of distorted ones beside them.
PLACES = (
    *("sparse", "colmap/sparse", ".", "colmap", "models", "dense/sparse", "dense"),
    *("distorted/sparse", "undistorted/sparse"),
    # Of hloc and of GLOMAP.
    *("sfm", "outputs/sfm", "outputs", "output", "glomap"),
)
# Where photos lie beside a model, or beside the folder that models lie in.
OF_PHOTOS = ("images", "input", "frames", "photos", "rgb")
# Beside a model of 3D Gaussian splatting's `convert.py` in this folder, undistorted
# photos lie in `images`, and its own in `input`.
DISTORTED = "distorted"
SUFFIXES, PARTS = (".bin", ".txt"), ("cameras", "images", "points3D")
# Of a file: COLMAP writes all points of 10,000 photos into less.
MAX_BYTES = 2**32
MODELS = {int(one): name for name, one in pycolmap.CameraModelId.__members__.items()}
# Of a line of images.txt: id, quaternion, translation, camera, name.
OF_IMAGE = 10


def find(folder):
    """Paths of all models in a project, those of the usual places first."""
    models = []
    for place in PLACES:
        here = Path(folder) / place
        inner = [p for p in here.glob("[0-9]*") if p.name.isdecimal() and suffix_of(p)]
        models += sorted(inner, key=lambda path: int(path.name))
        models += [here] if suffix_of(here) else []
    return models


def suffix_of(folder):
    """That of the files of a model in a folder, binary ones first; None without any."""
    for suffix in SUFFIXES:
        if all((folder / f"{part}{suffix}").is_file() for part in PARTS[:2]):
            return suffix
    return None


def images_in(model):
    """Number of images of a model; 0 of a file that is broken."""
    suffix = suffix_of(model)
    with contextlib.suppress(ValueError):
        return len(list(READERS[suffix][1](model / f"images{suffix}")))
    return 0


def by_size(folder):
    """{path: number of images} of the models in a project, the largest first.

    One that is alone is not looked into: its number is None.
    """
    if len(models := find(folder)) < 2:
        return dict.fromkeys(models)
    counts = {model: images_in(model) for model in models}
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


def tell_others(folder, taken, models):
    """Log which of several models is taken: they share no frame."""
    told = [f"{one.relative_to(folder)} of {n}" for one, n in models.items()]
    if len(told) > 1:
        own = told.pop(list(models).index(taken))
        log.warning(
            "%s: %d models: %s images is taken; left: %s",
            *(folder, len(models), own, ", ".join(told)),
        )


def with_photos(folder, chosen=None, choose=None) -> shots.Cameras | None:
    """The cameras of the largest model that has its photos; None without any model.

    chosen: the folder of photos. choose: as of `shots.placed`. Raises ValueError naming
    a photo where no model has its photos.
    """
    models, fault = by_size(folder), None
    for model in models:
        own = cameras_of(model)
        roots = [chosen] if chosen else roots_of(Path(folder), model, own)
        try:
            own = shots.placed(own, roots, choose=choose)
        except ValueError as error:
            fault = fault or error
            continue
        tell_others(folder, model, models)
        return own
    if fault:
        raise fault
    return None


def roots_of(folder, model, own):
    """The folders in which a model's photos may lie."""
    project = model.parent if model.name.isdecimal() else model
    project = project.parent if project.name in ("sparse", "models") else project
    bases = dict.fromkeys([project, project.parent, folder])
    bases = [base for base in bases if base.is_relative_to(folder)]
    usual = ["input"] if DISTORTED in model.relative_to(folder).parts else []
    named = ("*[_-]images", "*undistorted*")
    beside = [p for base in bases for name in named for p in sorted(base.glob(name))]
    straight = all(distortion.is_pinhole(shot.lens[1]) for shot in own.shots)
    beside.sort(key=lambda path: ("undistorted" in path.name) != straight)
    places = [base / name for base in bases for name in (*usual, *OF_PHOTOS)]
    return [*places, *shots.smaller_of(folder)[:1], *beside, *bases]


def missing(folder):
    """What a folder that is nearly a project lacks, in words; None of others."""
    for place in PLACES:
        for here in (Path(folder) / place / "0", Path(folder) / place):
            for suffix in SUFFIXES:
                there = [p for p in PARTS if (here / f"{p}{suffix}").is_file()]
                lacks = [p for p in PARTS[:2] if p not in there]
                if there and lacks:
                    names = " and ".join(f"{part}{suffix}" for part in lacks)
                    return f"{here}: a COLMAP model without {names}"
    return None


def cameras_of(folder) -> shots.Cameras:
    """The cameras of a model's folder, by name, and its points."""
    folder = Path(folder)
    suffix = suffix_of(folder)
    if suffix is None:
        raise ValueError(missing(folder) or f"{folder}: no COLMAP model")
    lenses_of, images_of, points_of = READERS[suffix]
    lenses, path = lenses_of(folder / f"cameras{suffix}"), folder / f"images{suffix}"
    found = []
    for name, (w, x, y, z, *shift), number in images_of(path):
        if number not in lenses:
            raise ValueError(f"{path}: {faults.name_of(name)}: no camera {number}")
        # Of a quaternion of another length the rotation alone is scaled.
        length = math.hypot(x, y, z, w) or 1.0
        turn = shots.rotation_of(np.array([x, y, z, w]))
        pose = shots.pose_from(turn, np.array(shift) / length)
        lens, size = lenses[number]
        found.append(shots.Shot(name, lens, pose, size))
    points = folder / f"points3D{suffix}"
    points = np.array(list(points_of(points)) if points.exists() else [])
    points = (points[:, :3], points[:, 3:].astype(np.uint8)) if len(points) else None
    found.sort(key=lambda shot: shot.name)
    return shots.cameras(path, found, "COLMAP's model", points=points)


class Binary:
    """A file of numbers that are read one after another."""

    def __init__(self, path):
        self.path, self.content, self.place = path, faults.content(path, MAX_BYTES), 0

    def read(self, form):
        """The numbers here; struct.error beyond the end."""
        found = struct.unpack_from(form, self.content, self.place)
        self.place += struct.calcsize(form)
        return found

    def text(self):
        start, self.place = self.place, self.content.index(b"\0", self.place) + 1
        return self.content[start : self.place - 1].decode(errors="replace")

    def entries(self, entry):
        """What a function reads of each entry; ValueError where the file is cut."""
        try:
            found = [entry(self) for _ in range(self.read("<Q")[0])]
            if self.place != len(self.content):
                raise ValueError(f"{len(self.content) - self.place} bytes too many")
        except (ValueError, OverflowError, struct.error) as error:
            raise ValueError(f"{self.path}: truncated or damaged: {error}") from None
        return found


def binary_lenses(path):
    def one(file):
        number, model, *size = file.read("<iiQQ")
        if (name := MODELS.get(model, "INVALID")) == "INVALID":
            raise ValueError(f"camera model {model}")
        count = len(pycolmap.Camera.create_from_model_name(1, name, 1.0, 1, 1).params)
        return number, name, size, file.read(f"<{count}d")

    found = Binary(path).entries(one)
    return {number: lens_of(path, *camera) for number, *camera in found}


def binary_images(path):
    def one(file):
        _, *numbers, camera = file.read("<I7dI")
        name = file.text()
        (count,) = file.read("<Q")
        file.place += 24 * count
        return name, numbers, camera

    return Binary(path).entries(one)


def binary_points(path):
    def one(file):
        _, *values, _, count = file.read("<Q3d3BdQ")
        file.place += 8 * count
        return values

    return Binary(path).entries(one)


def lens_of(path, model, size, params):
    """(lens, (width, height)) of a camera."""
    return shots.lens(path, model, params), (int(size[0]), int(size[1]))


def lines_of(path):
    """(where it stands, text) of the lines that are no comments; empty ones too."""
    for number, line in enumerate(faults.text(path, MAX_BYTES).split("\n"), 1):
        if not line.lstrip().startswith("#"):
            yield f"{path}: line {number}", line.strip()


def text_lenses(path):
    found = {}
    for where, line in filter(lambda one: one[1], lines_of(path)):
        words = line.split()
        if len(words) < 5:
            raise ValueError(f"{where}: not a camera: cut short?")
        values = shots.numbers(where, words[2:], len(words) - 2)
        found[words[0]] = lens_of(where, words[1], values[:2], values[2:])
    return found


def text_images(path):
    lines = lines_of(path)
    for where, line in filter(lambda one: one[1], lines):
        after, points = next(lines, (where, ""))
        words = points.split()
        # The last one is a point's number; of an image it is a part of its name.
        if len(words) % 3 or (words and not words[-1].lstrip("-").isdecimal()):
            raise ValueError(
                f"{after}: not the points of the image above it, which is a line of "
                "its own, empty where there are none"
            )
        words = line.split(maxsplit=OF_IMAGE - 1)
        if len(words) != OF_IMAGE:
            raise ValueError(f"{where}: not an image: cut short?")
        yield words[9], shots.numbers(where, words[1:8], 7), words[8]


def text_points(path):
    for where, line in filter(lambda one: one[1], lines_of(path)):
        yield shots.numbers(where, line.split()[1:7], 6)


READERS = {
    ".bin": (binary_lenses, binary_images, binary_points),
    ".txt": (text_lenses, text_images, text_points),
}
