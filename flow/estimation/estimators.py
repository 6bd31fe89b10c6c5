"""The estimators behind `estimate.estimate`, by name.

Each takes render and photo, [h, w, 3] uint8 RGB of one size, both sides at least
`min_side_px`, and gives flow_px [h, w, 2] float32 with render(x) ~ photo(x + flow(x)).
All but `simpleflow` work on the luminance 0.299 R + 0.587 G + 0.114 B, rounded to 8
bits (ITU-R BT.601). All give the same bits at every call.

Not here: OpenCV's PCA-Flow, dense RLOF and SparseToDense, see LEFT_OUT.
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


def _farneback(render, photo):
    # Window 15, five levels, polynomials over 7 px: as in OpenCV's own examples, with
    # two more iterations and levels.
    return cv2.calcOpticalFlowFarneback(
        _luminance(render), _luminance(photo), None, 0.5, 5, 15, 5, 7, 1.5, 0
    )


def _simpleflow(render, photo):
    pair = [np.ascontiguousarray(image) for image in (render, photo)]
    return cv2.optflow.createOptFlow_SimpleFlow().calc(*pair, None)


# dis_fine: full resolution, and patches and smoothing large enough not to fit the
# blur of a render as motion. dis_smooth: what a render shows wrongly, blur and
# artefacts of several pixels, is seen through by patches half as large again and a
# refinement that prefers smooth flow four times as much, with the iterations that this
# needs: on a trained model's renders nearly as right as deepflow, in less time.
#
# Smallest sides, found by trying sides in processes of their own: under 32 px DIS ends
# some pairs of sides (12x200, 31x200) in a segmentation fault, with patches of 24 px
# also 32x32; deepflow has too few scales under 48 px and finds 80 % of a shift.
METHODS = {
    "dis_ultrafast": Estimator(_dis(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST), 32),
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
    "dis_smooth": Estimator(
        _dis(
            cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
            FinestScale=0,
            PatchSize=24,
            PatchStride=8,
            VariationalRefinementAlpha=160.0,
            VariationalRefinementIterations=60,
        ),
        40,
    ),
    # dis_fine takes a quarter of its time.
    "deepflow": Estimator(
        _grey(cv2.optflow.createOptFlow_DeepFlow), 48, checked_by="dis_fine"
    ),
    "farneback": Estimator(_farneback, 32),
    "tvl1": Estimator(_grey(cv2.optflow.DualTVL1OpticalFlow_create), 32),
    "simpleflow": Estimator(_simpleflow, 32),
}
extensions.check_new("estimators", extensions.names("estimators"), METHODS)
METHODS |= extensions.of_group("estimators")

# Refused by name, with the reason (OpenCV 5.0).
LEFT_OUT = {
    "pcaflow": "OpenCV's PCA-Flow writes beyond its memory: pairs of 32x641, 31x200 "
    "and 32x32 pixels ended the process, and a larger one is no proof",
    "rlof": "OpenCV's dense RLOF reads memory that it never wrote where it finds few "
    "matches: textured against flat 96x97 pixels ended the process, 36x36 filled 16 GB",
    "sparsetodense": "OpenCV's SparseToDense reads beyond its memory on small or flat "
    "images",
}
