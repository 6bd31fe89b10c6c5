"""The estimators behind `estimate.estimate`, by name.

Each takes render and photo, [h, w, 3] uint8 RGB of one size, both sides at least
`min_side_px`, and gives flow_px [h, w, 2] float32 with render(x) ~ photo(x + flow(x)).
They work on the luminance 0.299 R + 0.587 G + 0.114 B (ITU-R BT.601), rounded to 8
bits, and give the same bits at every call. docs/measured/estimators.csv has errors.

Not here: OpenCV's PCA-Flow, dense RLOF and SparseToDense, which read or write beyond
their memory on small or flat images.
"""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

from alignerf.io.environment import extensions


class Estimator(NamedTuple):
    """An estimator and the shorter side from which on it is right, and survives.

    checked_by: in a training, the estimator of the flow back; its own, if None.
    """

    calculate: Callable
    min_side_px: int
    checked_by: str | None = None


def _luminance(image):
    return cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)


def _grey(create: Callable, **settings) -> Callable:
    """An estimator on the luminance: a new object per call, so that none learns."""

    def calculate(render, photo):
        estimator = create()
        for name, value in settings.items():
            getattr(estimator, f"set{name}")(value)
        return estimator.calc(_luminance(render), _luminance(photo), None)

    return calculate


def _dis(preset: int, **settings) -> Callable:
    return _grey(lambda: cv2.DISOpticalFlow_create(preset), **settings)


# dis_fine: full resolution, and patches and smoothing large enough not to fit the
# blur of a render as motion.
#
# Smallest sides, found by trying sides in processes of their own: under 32 px DIS ends
# some pairs of sides (12x200, 31x200) in a segmentation fault; deepflow has too few
# scales under 48 px and finds 80 % of a shift.
METHODS = {
    "dis_fast": Estimator(_dis(cv2.DISOPTICAL_FLOW_PRESET_FAST), 32),
    "dis_medium": Estimator(_dis(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM), 32),
    "dis_fine": Estimator(
        _dis(
            cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
            FinestScale=0,
            PatchSize=16,
            PatchStride=4,
            VariationalRefinementAlpha=40.0,
            VariationalRefinementIterations=10,
        ),
        32,
    ),
    # dis_fine takes a quarter of its time.
    "deepflow": Estimator(
        _grey(cv2.optflow.createOptFlow_DeepFlow), 48, checked_by="dis_fine"
    ),
}
extensions.check_new("estimators", extensions.names("estimators"), METHODS)
METHODS |= extensions.of_group("estimators")
