"""COLMAP's models in text, looked through before its own reader sees them.

COLMAP's reader takes a quaternion of 0 for no turn, cuts a name at its first space, and
leaves out every second image of a file without lines of points. Formats: COLMAP's
src/colmap/scene/reconstruction_io_text.cc.
"""

import math
from pathlib import Path

from alignerf.files import faults
from alignerf.scenes.capture import model_files

# Of a line of images.txt: id, quaternion, translation, camera, name.
OF_IMAGE = 10


def lines_of(path):
    """(number, text) of the lines that are no comments, from 1; empty ones too."""
    faults.check_regular(path)
    try:
        text = Path(path).read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not a text of COLMAP's") from None
    for number, line in enumerate(text.split("\n"), 1):
        if not line.lstrip().startswith("#"):
            yield number, line.strip()


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
    path = Path(folder) / "images.txt"
    for number, line in image_lines(path):
        words = line.split()
        if len(words) != OF_IMAGE:
            what = "a name with spaces?" if len(words) > OF_IMAGE else "cut short?"
            raise ValueError(f"{path}: line {number} has {len(words)} words: {what}")
        try:
            quaternion = [float(word) for word in words[1:5]]
            placed = all(math.isfinite(float(word)) for word in words[5:8])
        except ValueError:
            quaternion, placed = [], False
        if not placed or not model_files.is_rotation(quaternion):
            raise ValueError(f"{path}: line {number}: {words[9]} has no pose")


def count(folder):
    """Number of the images in a model in text."""
    return sum(1 for _ in image_lines(Path(folder) / "images.txt"))
