"""A toy test set: the photo, blurred."""

import cv2

from alignerf.testsets.base import TestSet

SIGMA_PX = 1.0


def blurred(view):
    """The photo blurred by SIGMA_PX, and where it counts."""
    return cv2.GaussianBlur(view.photo, (0, 0), SIGMA_PX), view.everywhere


SET = TestSet(
    name="blurred",
    pixels="all",
    meaning=f"the photo, blurred by {SIGMA_PX:g} px",
    needs="",
    make=blurred,
    tables=("misalignment", "comparison"),
)
