"""COLMAP's models in text, looked through before its own reader sees them.

COLMAP's reader takes a quaternion of 0 for no turn, cuts a name at its first space, and
leaves out every second image of a file without lines of points. Formats: COLMAP's
src/colmap/scene/reconstruction_io_text.cc.
"""

import codecs
import math
from pathlib import Path

from alignerf.files import faults
from alignerf.scenes.capture import model_files

# Of a file: COLMAP writes all points of 10,000 photos into less.
MOST_BYTES = 2**30
# Of a line of images.txt: id, quaternion, translation, camera, name.
OF_IMAGE = 10
# Numbers of a pose.
OF_POSE = 7


def lines_of(path):
    """(number, text) of the lines that are no comments, from 1; empty ones too."""
    for number, line in enumerate(text_of(path).split("\n"), 1):
        if not line.lstrip().startswith("#"):
            yield number, line.strip()


def text_of(path):
    """The text of a file; ValueError for a byte order mark: COLMAP takes none."""
    with faults.opened(path) as file:
        if file.read(3) == codecs.BOM_UTF8:
            raise ValueError(f"{path}: a byte order mark in it: save it without")
    return faults.text(path, MOST_BYTES)


def image_lines(path):
    """(number, text) of the lines of images.txt that name an image.

    After each comes a line of its points, which may be empty. Raises ValueError where
    that is something else.
    """
    is_points = False
    for number, line in lines_of(path):
        if is_points:
            words = line.split()
            if len(words) % 3:
                raise ValueError(
                    f"{path}: line {number}: not the points of the image above it, "
                    "which is a line of its own, empty where there are none"
                )
            is_points = False
        elif line:
            yield number, line
            is_points = True


def check(folder):
    """ValueError naming the file and the line of what COLMAP would misread."""
    for name in ("cameras.txt", "points3D.txt"):
        text_of(Path(folder) / name)
    path = Path(folder) / "images.txt"
    for number, line in image_lines(path):
        words = line.split()
        if len(words) != OF_IMAGE:
            what = "a name with spaces?" if len(words) > OF_IMAGE else "cut short?"
            raise ValueError(f"{path}: line {number} has {len(words)} words: {what}")
        if not is_pose(words[1:8]):
            raise ValueError(
                f"{path}: line {number}: {faults.name_of(words[9])} has no pose"
            )

    check_frames(Path(folder) / "frames.txt")
    check_rigs(Path(folder) / "rigs.txt")


def check_frames(path):
    """`check` of frames.txt, from which COLMAP takes poses where it is there."""
    for number, line in lines_of(path) if path.is_file() else ():
        if line and not is_pose(line.split()[2:9]):
            raise ValueError(f"{path}: line {number}: a frame without a pose")


def check_rigs(path):
    """`check` of rigs.txt: where each further sensor of a rig is."""
    for number, line in lines_of(path) if path.is_file() else ():
        # Of a sensor: its kind, its number, and whether a pose follows.
        words = line.split()[4:]
        while words:
            has_pose = words[2:3] == ["1"]
            if has_pose and not is_pose(words[3:10]):
                raise ValueError(f"{path}: line {number}: a sensor without a pose")
            words = words[10 if has_pose else 3 :]


def is_pose(words):
    """Whether seven words are a quaternion of length 1 and a place."""
    try:
        values = [float(word) for word in words]
    except ValueError:
        return False
    finite = len(values) == OF_POSE and all(map(math.isfinite, values))
    return finite and model_files.is_rotation(values[:4])


def count(folder):
    """Number of the images in a model in text."""
    return sum(1 for _ in image_lines(Path(folder) / "images.txt"))
