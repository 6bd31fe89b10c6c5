"""DeepFlow of OpenCV's main modules, for a machine without its contributed ones.

`optflow.createOptFlow_DeepFlow` is a loop over a pyramid around OpenCV's
`VariationalRefinement`, which every build has. Flows are the same to some thousandths
of a pixel.
"""

import types

import cv2
import numpy as np

SIGMA, SHRINK, MIN_PX, MAX_LEVELS = 0.6, np.float32(0.95), 25, 200
SETTINGS = {
    "Alpha": 4.0,
    "Delta": 0.5 / 3,
    "Gamma": 5.0 / 3,
    "FixedPointIterations": 5,
    "SorIterations": 25,
    "Omega": 1.6,
}


class DeepFlow:
    """The estimator, with the settings that OpenCV gives it."""

    def calc(self, render, photo, flow):
        """Flow [h, w, 2] float32 of grey images [h, w]; `flow` is not read."""
        levels = [list(self.pyramid(image)) for image in (render, photo)]
        found = None
        for first, second in zip(*map(reversed, levels), strict=True):
            height, width = first.shape
            if found is None:
                found = np.zeros((height, width, 2), np.float32)
            else:
                found = cv2.resize(found, (width, height)) * (1 / SHRINK)
            refine = cv2.VariationalRefinement_create()
            for name, value in SETTINGS.items():
                getattr(refine, f"set{name}")(value)
            found = refine.calc(first, second, found)
        return found

    def pyramid(self, image):
        """The image, and smaller ones as long as they are large enough."""
        side = 2 * int(3 * SIGMA) + 1
        now = cv2.GaussianBlur(image.astype(np.float32), (side, side), SIGMA)
        for _ in range(MAX_LEVELS + 1):
            yield now
            size = [int(n * SHRINK + np.float32(0.5)) for n in now.shape[::-1]]
            if min(size) <= MIN_PX:
                return
            now = cv2.resize(now, size)


def stand_in():
    """Give OpenCV an `optflow` with this estimator, where it has none."""
    if not hasattr(cv2, "optflow"):
        cv2.optflow = types.SimpleNamespace(
            createOptFlow_DeepFlow=DeepFlow, DualTVL1OpticalFlow_create=None
        )
