"""COLMAP's models: where they lie in a project, what is wrong with them, their views.

In each place (PLACES) a model lies in a folder of its number, or at once. A model is
three files, .bin or .txt. COLMAP writes several where photos do not hang together: they
share no frame, so the one with most images is taken, and the others are named.

Files are looked through before COLMAP's own reader sees them. It trusts a binary file's
counts: on one that was cut short it takes minutes and 15 GB. Of texts it takes a
quaternion of 0 for no turn, cuts a name at its first space, stops at a byte order mark,
and leaves out every second image of a file without lines of points. Without a file of
points it reads nothing; here cameras do without. Formats: COLMAP's
src/colmap/scene/reconstruction_io_binary.cc and reconstruction_io_text.cc.
"""

import codecs
import contextlib
import logging
import math
import struct
import tempfile
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pycolmap

from alignerf.io import faults
from alignerf.scenes import cameras as scene_cameras
from alignerf.scenes import colmap, distortion, photo_names, photos

log = logging.getLogger(__name__)

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
SUFFIXES = (".bin", ".txt")
PARTS = ("cameras", "images", "points3D")
FILES = (*PARTS, "frames", "rigs")
# Of a file: COLMAP writes all points of 10,000 photos into less.
MAX_TEXT_BYTES = 2**30
# Of a line of images.txt: id, quaternion, translation, camera, name.
OF_IMAGE = 10
# Numbers of parameters by the model's number.
PARAMETERS = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12, 16, 4, 5, 3, 4, 6, 2)
# Of a file: COLMAP's own reader takes several times as much.
MAX_BYTES = 2**32
OF_POINT_2D, OF_TRACK, OF_DATA = 24, 8, 16


def find(folder):
    """Paths of all models in a project, those of the usual places first."""
    models = []
    for place in PLACES:
        here = Path(folder) / place
        inner = [p for p in here.glob("[0-9]*") if p.name.isdecimal() and is_model(p)]
        models += sorted(inner, key=lambda path: int(path.name))
        models += [here] if is_model(here) else []
    return models


def is_model(folder):
    """Whether a folder has the files of a model, whatever they hold."""
    return any(
        (folder / f"cameras{suffix}").is_file()
        and (folder / f"images{suffix}").is_file()
        for suffix in SUFFIXES
    )


def is_text(folder):
    """Whether COLMAP would read a model's texts; with both kinds it reads the other."""
    return not all((folder / f"{part}.bin").exists() for part in PARTS)


def images_in(model):
    """Number of images that a model says it has; 0 of a file that is cut short."""
    if is_text(model) and (model / "images.txt").is_file():
        return sum(1 for _ in image_lines(model / "images.txt"))
    with faults.opened(model / "images.bin") as file:
        head = file.read(8)
    return struct.unpack("<Q", head)[0] if len(head) == 8 else 0


def by_size(folder):
    """{path: number of images} of the models in a project, the largest first.

    One that is alone is not looked into: its number is None.
    """
    if len(models := find(folder)) < 2:
        return dict.fromkeys(models)
    counts = {model: images_in(model) for model in models}
    return dict(sorted(counts.items(), key=lambda item: -item[1]))


class Project(NamedTuple):
    """A model and its photos: what `read` gives, and {image's name: path} below root.

    Images whose photo is gone are in `cameras` alone.
    """

    model: Path
    cameras: dict
    points: tuple | None
    root: Path
    photos: dict


def with_photos(folder, chosen=None, choose=None):
    """The Project of the largest model that has its photos; None without any model.

    All but `photo_names.MAX_MISSING` of them; what is left is said. chosen: the folder
    of photos. choose: `sfm.pairing.choose`; None for the first folder, and the lens of
    the model. Raises ValueError naming a photo where no model has its photos.
    """
    models, fault = by_size(folder), None
    for model in models:
        cameras, points = read(model)
        found = photos_for(Path(folder), model, cameras, chosen)
        root, photos_of = found[0]
        gone = sorted(cameras.keys() - photos_of.keys())
        few = faults.some_names(gone)
        if len(gone) > photo_names.MAX_MISSING * len(cameras):
            fault = fault or f"{root}: no photo {few}, which {model} has a pose for"
            continue
        if gone:
            log.warning("%s: left out, as their photos are gone: %s", model, few)
        told = {one: f"{one.relative_to(folder)} of {n}" for one, n in models.items()}
        if others := [told[one] for one in models if one != model]:
            log.warning(
                "%s: %d models: %s images is taken; left: %s",
                *(folder, len(models), told[model], ", ".join(others)),
            )
        if choose:
            k, cameras = choose(model, cameras, [own for _, own in found])
            root, photos_of = found[k]
        return Project(model, cameras, points, root, photos_of)
    if fault:
        raise ValueError(fault)
    return None


def photos_for(folder, model, cameras, chosen=None):
    """[(folder of a model's photos, {name: path})]: that where most of them lie.

    Of those with all, each whose photos are as large as the cameras, which are those of
    undistorted photos or of the originals. cameras: as of `read`.
    """
    project = model.parent if model.name.isdecimal() else model
    project = project.parent if project.name in ("sparse", "models") else project
    bases = dict.fromkeys([project, project.parent, folder])
    bases = [base for base in bases if base.is_relative_to(folder)]
    usual = ["input"] if DISTORTED in model.relative_to(folder).parts else []
    places = [base / name for base in bases for name in (*usual, *OF_PHOTOS)]
    smaller = sorted(
        (path for path in folder.glob("images_*") if path.name[7:].isdecimal()),
        key=lambda path: int(path.name[7:]),
    )
    named = ("*[_-]images", "*undistorted*")
    beside = [p for base in bases for name in named for p in sorted(base.glob(name))]
    straight = all(distortion.is_pinhole(one[3]) for one in cameras.values())
    beside.sort(key=lambda path: ("undistorted" in path.name) != straight)
    roots = [chosen] if chosen else [*places, *smaller[:1], *beside, *bases]
    best, whole = (roots[-1], {}), {}
    for root in filter(Path.is_dir, dict.fromkeys(roots)):
        # Above a folder with all of them the same ones are found.
        if whole and root in bases:
            break
        found = photo_names.match(cameras, photo_names.listed(root))
        own = root, {name: root / path for name, path in found.items()}
        if len(found) > len(best[1]):
            best = own
        if len(found) == len(cameras) and is_as_large(cameras, own[1]):
            whole.setdefault(faults.resolved(root), own)
    return [*whole.values()] or [best]


def is_as_large(cameras, found):
    """Whether the first photo is as large as its camera; not so a broken one."""
    name, path = next(iter(found.items()))
    with contextlib.suppress(ValueError):
        return photos.head(path).size == cameras[name][1]
    return False


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


def read(path):
    """{image's name: (camtopix, (width, height), camera-to-world, distortion)}.

    And its points, None where it has none: positions and colours (uint8), both [m, 3].
    """
    check_binaries(path)
    names = {}
    with tempfile.TemporaryDirectory() as plain:
        own = path
        if is_text(path) and (path / "images.txt").is_file():
            names = check_texts(path)
            if not is_plain(path, names):
                own = Path(plain)
                write_plain(path, own)
        elif is_model(path) and not (path / "points3D.bin").exists():
            own = Path(plain)
            link_without_points(path, own)
        try:
            model = pycolmap.Reconstruction(own)
        # Whatever COLMAP's reader finds wrong is the file's fault.
        except Exception as error:
            first = " ".join(str(error).splitlines()[:1])
            reason = f"a file is missing, truncated or damaged ({first})"
            raise ValueError(f"{path}: not a COLMAP model: {reason}") from None
    normalize(model)
    views = {}
    for image in model.images.values():
        if not image.has_pose:
            continue
        name = names.get(image.image_id, image.name)
        camera = model.cameras[image.camera_id]
        if name in views:
            raise ValueError(f"{path}: two images are called {faults.shown(name)}")
        try:
            lens = colmap.lens(camera.model.name, camera.params)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
        size, pose = (camera.width, camera.height), colmap.pose_of(image)
        views[name] = lens[0], size, pose, lens[1]
    if not views:
        raise ValueError(f"{path}: no image has a pose")
    points = list(model.points3D.values())
    if not points:
        return views, None
    positions = np.array([point.xyz for point in points])
    return views, (positions, np.array([point.color for point in points], np.uint8))


def check_lengths(path, turns):
    """ValueError as of `cameras.nearest_rotations`; turns: {name: its quaternion}.

    COLMAP's reader would take one of length 0 for no turn.
    """
    lengths = np.array([math.hypot(*turn) for turn in turns.values()])
    scaled = lengths[:, None, None] * np.eye(3)
    scene_cameras.nearest_rotations(path, [*turns], scaled)


def normalize(model):
    """Make quaternions of length 1 in a pycolmap.Reconstruction, as read."""
    poses = [f.rig_from_world for f in model.frames.values() if f.has_pose()]
    for rig in model.rigs.values():
        poses += filter(None, rig.non_ref_sensors.values())
    for pose in poses:
        pose.rotation.normalize()


class Walk:
    """A position in the content of a binary file, which moves forwards by entries.

    Each method but the first three passes one entry of the file of its name.
    turns: {name: quaternion} of the poses that were passed.
    """

    def __init__(self, content):
        self.content, self.place, self.turns = content, 0, {}

    def read(self, form):
        """The numbers here; struct.error beyond the end."""
        values = struct.unpack_from(form, self.content, self.place)
        self.place += struct.calcsize(form)
        return values

    def skip(self, size, form):
        """Pass as many parts of a size as the number here says."""
        (count,) = self.read(form)
        self.place += size * count

    def cameras(self):
        _, number, *_ = self.read("<iiQQ")
        if not 0 <= number < len(PARAMETERS):
            raise ValueError(f"camera model {number}")
        self.read(f"<{PARAMETERS[number]}d")

    def images(self):
        self.read("<I")
        turn = self.read("<7d")[:4]
        self.read("<I")
        start, self.place = self.place, self.content.index(b"\0", self.place) + 1
        name = self.content[start : self.place - 1].decode(errors="replace")
        self.turns[name] = turn
        self.skip(OF_POINT_2D, "<Q")

    def points3D(self):
        self.read("<Q3d3Bd")
        self.skip(OF_TRACK, "<Q")

    def frames(self):
        number, _ = self.read("<II")
        self.turns[f"frame {number}"] = self.read("<7d")[:4]
        self.skip(OF_DATA, "<I")

    def rigs(self):
        _, sensors = self.read("<II")
        self.read("<Q" if sensors else "")
        for _ in range(sensors - 1):
            _, number, has_pose = self.read("<IIB")
            if has_pose:
                self.turns[f"sensor {number}"] = self.read("<7d")[:4]


def check_binaries(folder):
    """ValueError naming a file of a model that is shorter than its counts say."""
    for name in FILES:
        text, path = (Path(folder) / f"{name}{kind}" for kind in (".txt", ".bin"))
        if text.exists():
            faults.check_regular(text)
        if not path.exists():
            continue
        walk = Walk(faults.content(path, MAX_BYTES))
        try:
            for _ in range(walk.read("<Q")[0]):
                getattr(walk, name)()
            if walk.place != len(walk.content):
                raise ValueError(f"{len(walk.content) - walk.place} bytes too many")
        except (ValueError, OverflowError, struct.error) as error:
            raise ValueError(f"{path}: truncated or damaged: {error}") from None
        check_lengths(path, walk.turns)


def lines_of(path):
    """(number, text) of the lines that are no comments, from 1; empty ones too."""
    for number, line in enumerate(text_of(path).split("\n"), 1):
        if not line.lstrip().startswith("#"):
            yield number, line.strip()


def text_of(path):
    return faults.text(path, MAX_TEXT_BYTES)


def image_lines(path):
    """(number, text, text of its points) of the images in images.txt.

    The points' line is that after the image's, and may be empty. Raises ValueError
    where it is something else.
    """
    lines = lines_of(path)
    for number, line in lines:
        if not line:
            continue
        after, points = next(lines, (number + 1, ""))
        words = points.split()
        # The last one is a point's number; of an image it is a part of its name.
        if len(words) % 3 or (words and not words[-1].lstrip("-").isdecimal()):
            raise ValueError(
                f"{path}: line {after}: not the points of the image above it, "
                "which is a line of its own, empty where there are none"
            )
        yield number, line, points


def check_texts(folder):
    """{image's number: name}; ValueError naming the line of what COLMAP would misread.

    A name is all that follows the numbers, with its spaces.
    """
    folder = Path(folder)
    text_of(folder / "cameras.txt")
    if (points := folder / "points3D.txt").exists():
        text_of(points)
    path, names, turns = folder / "images.txt", {}, {}
    for number, line, _ in image_lines(path):
        words = line.split(maxsplit=OF_IMAGE - 1)
        if len(words) != OF_IMAGE or not words[0].isdecimal():
            raise ValueError(f"{path}: line {number}: not an image: cut short?")
        named = faults.name_of(words[9])
        turn = turn_of(words[1:8], f"{path}: line {number}: {named}")
        names[int(words[0])], turns[words[9]] = words[9], turn
    check_lengths(path, turns)
    check_further_poses(folder)
    return names


def is_plain(folder, names):
    """Whether COLMAP's reader takes the texts as they are."""
    paths = [folder / f"{part}.txt" for part in FILES]
    there = [path for path in paths if path.is_file()]
    marked = any(map(starts_with_mark, there)) or folder / "points3D.txt" not in there
    return not marked and not any(len(name.split()) > 1 for name in names.values())


def starts_with_mark(path):
    with faults.opened(path) as file:
        return file.read(3) == codecs.BOM_UTF8


def write_plain(folder, to):
    """Copies of a model's texts without marks and, as names, the images' numbers.

    Points, where there are none, are an empty text.
    """
    (to / "points3D.txt").touch()
    for part in FILES:
        path = folder / f"{part}.txt"
        if not path.is_file():
            continue
        lines = [line for _, line in lines_of(path)]
        if part == "images":
            lines = []
            for _, line, points in image_lines(path):
                words = line.split(maxsplit=OF_IMAGE - 1)
                lines += [" ".join([*words[:-1], words[0]]), points]
        (to / path.name).write_text("\n".join([*lines, ""]))


def link_without_points(folder, to):
    """Links to a model's binary files, and a file of no points."""
    for part in FILES:
        if (path := folder / f"{part}.bin").is_file():
            (to / path.name).symlink_to(path.resolve())
    (to / "points3D.bin").write_bytes(struct.pack("<Q", 0))


def check_further_poses(folder):
    """`check_texts` of frames.txt and rigs.txt, from which COLMAP takes poses, too."""
    for name, poses_of in (("frames", pose_of_frame), ("rigs", poses_of_sensors)):
        path, turns = Path(folder) / f"{name}.txt", {}
        for number, line in lines_of(path) if path.is_file() else ():
            for k, words in enumerate(poses_of(line.split()) if line else (), 1):
                at = f"line {number}, pose {k}"
                turns[at] = turn_of(words, f"{path}: line {number}")
        check_lengths(path, turns)


def pose_of_frame(words):
    return [words[2:9]]


def poses_of_sensors(words):
    """The words of the poses of a rig's further sensors.

    Of each there are its kind, its number, and whether a pose follows.
    """
    rest, found = words[4:], []
    while rest:
        has_pose = rest[2:3] == ["1"]
        if has_pose:
            found.append(rest[3:10])
        rest = rest[10 if has_pose else 3 :]
    return found


def turn_of(words, where):
    """The quaternion of seven words of a pose; ValueError where these are none."""
    with contextlib.suppress(ValueError):
        values = [float(word) for word in words]
        if len(values) == 7 and all(map(math.isfinite, values)):
            return values[:4]
    raise ValueError(f"{where} has no pose")
