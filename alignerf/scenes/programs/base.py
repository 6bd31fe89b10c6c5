"""What all formats are read into: a photo's name, its lens and its pose."""

from typing import NamedTuple

import numpy as np

from alignerf.scenes import cameras, colmap, prepare
from alignerf.scenes.formats import shots


class Given(NamedTuple):
    """A photo's camera as a file gives it.

    camtopix [3, 3] and distortion, as in `scenes.distortion`, are of `size`: (width,
    height) in px. It is None where a file does not say: then they are in px of the
    photo, and the principal point is counted from its middle. camtoworld [3, 4]: with
    OpenGL axes.
    """

    name: str
    camtopix: np.ndarray
    distortion: np.ndarray
    size: tuple | None
    camtoworld: np.ndarray

    def sized(self, size):
        """The same with a size; it is the photo's, where the file does not say."""
        if self.size is not None:
            return self
        middle = np.zeros((3, 3))
        middle[:2, 2] = np.array(size) / 2
        return self._replace(camtopix=self.camtopix + middle, size=tuple(size))

    def at(self, size, where):
        """(camtopix, distortion) at the photo's (width, height).

        Raises ValueError as of `prepare.true_scale`.
        """
        own = self.sized(size)
        scale = prepare.true_scale(own.size, size, where=where)
        return scale @ own.camtopix, own.distortion


def lens(where, model, params):
    """(camtopix, distortion) of a camera of COLMAP's; ValueError naming `where`."""
    if not all(map(shots.is_number, params)):
        raise ValueError(f"{where}: a lens of {params}")
    try:
        return colmap.lens(model, np.array(params, np.float64))
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def pose(where, rotation, place):
    """Camera-to-world [3, 4], OpenGL axes, of a rotation with OpenCV's."""
    turn = prepare.nearest_rotation(rotation, where=f"{where}: its rotation")
    turn = turn @ cameras.OPENGL_FROM_OPENCV
    return np.concatenate([turn, np.reshape(place, (3, 1))], axis=1)


def numbers(where, words, count):
    """[count] float64 of words of a text; ValueError naming `where`."""
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = None
    return shots.numbers(where, values, f"{' '.join(words)[:60]!r}", count)
