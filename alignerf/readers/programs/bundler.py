"""Bundler's bundle.out, with the list of its photos beside it.

A camera is f, k1, k2, a rotation and a translation from the world, whose camera looks
along its -z, y up. An image's origin is its middle; nothing says its size. Cameras of
f = 0 have no pose. Format: snavely/bundler_sfm, README.md. COLMAP, VisualSFM and
RealityCapture write it, too, and lists of other names.
"""

import functools
import re
from pathlib import Path

import numpy as np

from alignerf.io import faults
from alignerf.readers import shots
from alignerf.scenes import cameras

NAME = "Bundler"
PATTERNS = ("*.out",)
MARK = b"# Bundle file"
MAX_BYTES = 2**30
LISTS = ("{path}.list.txt", "{stem}.list.txt", "list.txt", "*list*.txt", "{stem}.txt")
# What Bundler writes after a name: 0, and the focal length by EXIF.
AFTER_NAME = re.compile(r"\s+0(\s+[-+.\deE]+)?\s*$")
OF_CAMERA = 15


def read(path):
    lines = faults.text(path, MAX_BYTES).splitlines()
    words = " ".join(line for line in lines if not line.startswith("#")).split()
    count = int(shots.numbers(path, words[:1], 1)[0])
    if not 0 < count <= len(words) // OF_CAMERA:
        raise ValueError(f"{path}: cut short: {count} cameras are to be in it")
    found = []
    for i, name in enumerate(names_of(Path(path), count)):
        where = f"{path}: {faults.name_of(name)}"
        own = words[2 + OF_CAMERA * i :][:OF_CAMERA]
        focal, k1, k2, *rest = shots.numbers(where, own, OF_CAMERA)
        if focal == 0:
            continue
        turn, shift = np.reshape(rest[:9], (3, 3)), np.array(rest[9:])
        flip = cameras.OPENGL_FROM_OPENCV
        lens = functools.partial(of_middle, where=where, numbers=(focal, k1, k2))
        pose = shots.pose_from(flip @ turn, flip @ shift)
        found.append(shots.Shot(name, lens, pose, is_own=True))
    return found


def of_middle(size, where, numbers):
    """The `Shot.lens` of a focal length, k1 and k2."""
    focal, *bent = numbers
    return shots.lens(where, "RADIAL", [focal, size[0] / 2, size[1] / 2, *bent])


def names_of(path, count):
    """The photos' names, of the first list that has as many."""
    known = {"path": path.name, "stem": path.stem}
    for pattern in LISTS:
        for folder in (path.parent, path.parent.parent):
            for file in sorted(folder.glob(pattern.format(**known))):
                names = faults.text(file, MAX_BYTES).splitlines()
                names = [AFTER_NAME.sub("", name).strip() for name in names if name]
                if len(names) == count:
                    return names
    raise ValueError(
        f"{path}: no list of its {count} photos beside it, such as list.txt: cameras "
        "have no names in it"
    )
