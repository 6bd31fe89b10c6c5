"""Photos of one sensor, laid alike: portrait and landscape of one phone are one camera.

A phone stores what its sensor saw and writes into EXIF how the phone was held. Turned
upright, its photos have two shapes and two cameras; as stored they have one. So all are
turned as most of them are. Notation: `orientation` is EXIF's, 1 to 8; a turn is a
quarter of a circle, clockwise.
"""

from collections import Counter
from typing import NamedTuple

import numpy as np

from alignerf.scenes.photos import SIDEWAYS, UPRIGHT

# Those without a mirror, and the turns that they ask for.
TURNS = {1: 0, 6: 1, 3: 2, 8: 3}


class Lay(NamedTuple):
    """The turns that make a photo lie as the others do."""

    # EXIF's orientation that is applied to the rows as stored.
    orientation: int
    # Then a turn back, for photos that lie across without EXIF's word.
    across: bool
    # Turns that make the result upright.
    turns: int
    # Photos of one kind may share a camera.
    kind: str

    def apply(self, image):
        """Rows as stored [h, w, 3] -> as all photos lie."""
        image = UPRIGHT[self.orientation](image)
        image = np.rot90(image) if self.across else image
        return np.ascontiguousarray(image)


def upright_size(size, orientation):
    """(width, height) after an orientation is applied."""
    return size[::-1] if orientation in SIDEWAYS else size


def lay_alike(heads):
    """((width, height), Lay) of each photo, laid like the others.

    heads: (stored (width, height), orientation) of each photo. Photos of another size
    lie with their longer side as most photos have it.
    """
    plain = Counter(o for _, o in heads if o in TURNS)
    # Of equally many the least: 1, as stored.
    common = min(plain, key=lambda o: (-plain[o], o)) if plain else 1
    shapes = Counter(upright_size(s, common if o in TURNS else o) for s, o in heads)
    usual = max(shapes, key=lambda size: (shapes[size], size))
    return [_lay(size, o, common, usual) for size, o in heads]


def _lay(size, orientation, common, usual):
    """((width, height), Lay) of one photo: as most lie, where it can."""
    if orientation in TURNS and upright_size(size, common) == usual:
        turns = (TURNS[orientation] - TURNS[common]) % 4
        return usual, Lay(common, False, turns, "sensor")
    own = upright_size(size, orientation)
    if own == usual:
        return usual, Lay(orientation, False, 0, "upright")
    kind = "" if own == usual[::-1] else f"{max(own)}x{min(own)}"
    if (own[0] < own[1]) == (usual[0] < usual[1]) or own[0] == own[1]:
        return own, Lay(orientation, False, 0, kind)
    return own[::-1], Lay(orientation, True, 1, f"{kind} across".strip())
