"""What all formats are read into: a `shots.Shot` without its photo as yet."""

import numpy as np

from alignerf.scenes import cameras, colmap
from alignerf.scenes.formats import shots


def given(name, lens, size, pose) -> shots.Shot:
    """The camera of a photo that a file calls by a name.

    lens: (camtopix, distortion), of (width, height) `size` in px. It is None where a
    file does not say: then the lens is in px of the photo, and the principal point is
    counted from its middle.
    """
    camtopix, distortion = lens
    return shots.Shot(name, None, camtopix, size, pose, distortion)


def sized(shot: shots.Shot, size) -> shots.Shot:
    """The same with a size: the photo's (width, height), where the file has none."""
    if shot.size is not None:
        return shot
    middle = np.zeros((3, 3))
    middle[:2, 2] = np.array(size) / 2
    return shot._replace(camtopix=shot.camtopix + middle, size=tuple(size))


def lens(where, model, params):
    """(camtopix, distortion) of a camera of COLMAP's; ValueError naming `where`."""
    if not all(map(shots.is_number, params)):
        raise ValueError(f"{where}: a lens of {params}")
    try:
        return colmap.lens(model, np.array(params, np.float64))
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def pose(rotation, place):
    """Camera-to-world [3, 4], OpenGL axes, of a rotation with OpenCV's."""
    turn = rotation @ cameras.OPENGL_FROM_OPENCV
    return np.concatenate([turn, np.reshape(place, (3, 1))], axis=1)


def numbers(where, words, count):
    """[count] float64 of words of a text; ValueError naming `where`."""
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = None
    return shots.numbers(where, values, f"{' '.join(words)[:60]!r}", count)
