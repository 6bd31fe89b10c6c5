"""COLMAP's binary models, walked through before its own reader sees them.

COLMAP's reader trusts a file's counts: on a file that was cut short it takes minutes
and 15 GB. Formats: COLMAP's src/colmap/scene/reconstruction_io_binary.cc.
"""

import math
import struct
from pathlib import Path

from alignerf.files import faults

# Numbers of parameters by the model's number.
PARAMETERS = (3, 4, 4, 5, 8, 8, 12, 5, 4, 5, 12, 16, 4, 5, 3, 4, 6, 2)
LENGTH_ERROR = 1e-2
# Of a file: COLMAP's own reader takes several times as much.
MOST_BYTES = 2**32
OF_POINT_2D, OF_TRACK, OF_DATA, OF_POSE = 24, 8, 16, 56


class Walk:
    """A position in a file's bytes that moves forwards; ValueError beyond the end."""

    def __init__(self, content):
        self.content, self.place = content, 0

    def skip(self, size):
        self.place += size
        if self.place > len(self.content):
            raise ValueError("it is cut short")

    def read(self, form):
        start = self.place
        self.skip(struct.calcsize(form))
        (value,) = struct.unpack_from(form, self.content, start)
        return value

    def skip_text(self):
        end = self.content.find(b"\0", self.place)
        self.skip(len(self.content) - self.place + 1 if end < 0 else 0)
        self.place = end + 1


def camera(walk):
    walk.skip(4)
    number = walk.read("<i")
    if not 0 <= number < len(PARAMETERS):
        raise ValueError(f"camera model {number}")
    walk.skip(16 + 8 * PARAMETERS[number])


def is_rotation(quaternion):
    """Whether four numbers have length 1, as files print them.

    COLMAP's reader would take one of length 0 for no turn.
    """
    return len(quaternion) == 4 and abs(math.hypot(*quaternion) - 1) < LENGTH_ERROR


def pose(walk):
    """A quaternion and a place."""
    if not is_rotation([walk.read("<d") for _ in range(4)]):
        raise ValueError("a quaternion is not of length 1")
    walk.skip(OF_POSE - 32)


def image(walk):
    walk.skip(4)
    pose(walk)
    walk.skip(4)
    walk.skip_text()
    walk.skip(OF_POINT_2D * walk.read("<Q"))


def point(walk):
    walk.skip(8 + 24 + 3 + 8)
    walk.skip(OF_TRACK * walk.read("<Q"))


def frame(walk):
    walk.skip(8)
    pose(walk)
    walk.skip(OF_DATA * walk.read("<I"))


def rig(walk):
    walk.skip(4)
    sensors = walk.read("<I")
    if sensors:
        walk.skip(8)
    for _ in range(sensors - 1):
        walk.skip(8)
        if walk.read("<B"):
            pose(walk)


ENTRIES = {"cameras": camera, "images": image, "points3D": point}
ENTRIES |= {"frames": frame, "rigs": rig}


def check(folder):
    """ValueError naming a file of a model that is shorter than its counts say."""
    for name, entry in ENTRIES.items():
        text, path = (Path(folder) / f"{name}{kind}" for kind in (".txt", ".bin"))
        if text.exists():
            faults.check_regular(text)
        if not path.exists():
            continue
        walk = Walk(faults.content(path, MOST_BYTES))
        try:
            for _ in range(walk.read("<Q")):
                entry(walk)
            if walk.place != len(walk.content):
                raise ValueError(f"{len(walk.content) - walk.place} bytes too many")
        except ValueError as error:
            raise ValueError(f"{path}: truncated or damaged: {error}") from None
