"""Photos that lie there twice: what one of them teaches, the other does not test."""

import cv2
import numpy as np

from alignerf.metrics import pairs

# Small pictures of this side; copies differ by fewer levels of 8 bits (RMS), and by a
# smaller part of their contrast: JPEG of quality 75 comes to 0.8 levels and 0.015,
# neighbours of six captures to 3.5 and 0.09 and more.
SIDE_PX, LEVELS, CONTRAST = 32, 2.0, 0.05
# Of one place: turntables have photos that are nearly alike. In the unit of a scene's
# frame, in which cameras are 1 apart, and of directions.
PLACE = 0.01


def small(photo):
    """[SIDE_PX * SIDE_PX] float32 of a photo's luminance, made small."""
    side = SIDE_PX, SIDE_PX
    return cv2.resize(pairs.grey(photo), side, interpolation=cv2.INTER_AREA).ravel()


def of(pictures, camtoworlds):
    """Indices of the pictures [n, pixels] that show what an earlier one shows.

    camtoworlds [n, 3, 4]: their poses.
    """
    pictures, found = np.array(pictures), []
    for i in range(1, len(pictures)):
        apart = np.sqrt(np.square(pictures[:i] - pictures[i]).mean(axis=1))
        same = apart < min(LEVELS, CONTRAST * pictures[i].std())
        moved = camtoworlds[:i, :, 2:] - camtoworlds[i, :, 2:]
        if (same & (np.abs(moved).max(axis=(1, 2)) < PLACE)).any():
            found.append(i)
    return found
