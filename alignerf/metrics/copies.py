"""Photos that lie there twice: what one of them teaches, the other does not test."""

import cv2
import numpy as np

# Small pictures of this side; copies differ by fewer levels of 8 bits (RMS): JPEG of
# quality 75 comes to 0.8, neighbours of six captures to 3.5 and more.
SIDE_PX, LEVELS = 32, 1.5


def small(photo):
    """[SIDE_PX * SIDE_PX] float32 of a photo's luminance, made small."""
    grey = cv2.cvtColor(np.ascontiguousarray(photo), cv2.COLOR_RGB2GRAY)
    side = SIDE_PX, SIDE_PX
    return cv2.resize(
        grey.astype(np.float32), side, interpolation=cv2.INTER_AREA
    ).ravel()


def of(pictures):
    """Places of the pictures that show what an earlier one shows."""
    found = []
    for place, picture in enumerate(pictures):
        if place:
            apart = np.square(np.array(pictures[:place]) - picture).mean(axis=1).min()
            if apart < LEVELS**2 and picture.std() > LEVELS:
                found.append(place)
    return found
