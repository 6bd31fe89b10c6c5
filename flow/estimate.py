"""Optical flow from a render to a photo.

Notation: `flow_px` [h, w, 2] float32, x then y in pixels, with
render(x) ~ photo(x + flow_px(x)); images [h, w, 3] uint8 RGB; `sigma_px` standard
deviation of a Gaussian blur. x is an array index: pixel centres are integers here.
"""

from collections.abc import Callable

import cv2
import numpy as np

from flow import warp

# Under 32 pixels a side some pairs of sides crash DIS (OpenCV 5.0: 12x200 and
# 31x200 end in a segmentation fault) instead of raising.
MIN_SIDE_PX = 32

# A render of a misaligned scene is rarely blurrier than 3 pixels; finer steps than
# a quarter of a pixel did not change the flow.
SIGMAS_PX = (0.0, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)


def _dis(preset: int, **settings) -> Callable:
    def calculate(render_grey, photo_grey):
        estimator = cv2.DISOpticalFlow_create(preset)
        for name, value in settings.items():
            getattr(estimator, f"set{name}")(value)
        return estimator.calc(render_grey, photo_grey, None)

    return calculate


def _deepflow(render_grey, photo_grey):
    return cv2.optflow.createOptFlow_DeepFlow().calc(render_grey, photo_grey, None)


# dis_fine: full resolution, and patches and smoothing large enough not to fit the
# blur of a render as motion. All give the same bits for any number of threads.
METHODS: dict[str, Callable] = {
    "dis_ultrafast": _dis(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST),
    "dis_fast": _dis(cv2.DISOPTICAL_FLOW_PRESET_FAST),
    "dis_medium": _dis(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM),
    "dis_fine": _dis(
        cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
        FinestScale=0,
        PatchSize=16,
        PatchStride=4,
        VariationalRefinementAlpha=40.0,
        VariationalRefinementIterations=10,
    ),
    "deepflow": _deepflow,
}
DEFAULT = "dis_fine"


def estimate(render, photo, *, method=DEFAULT, match_blur=False):
    """Flow [h, w, 2] float32 with render(x) ~ photo(x + flow(x)).

    render, photo: [h, w, 3] uint8 RGB of one size, sides of at least 32 px. Works on
    the luminance 0.299 R + 0.587 G + 0.114 B, rounded to 8 bits (ITU-R BT.601).
    method: a key of METHODS. match_blur: blur the photo as the render is before the
    flow (see `blur_match`). Identical images give exactly zero. Raises ValueError.
    """
    _check(render, photo, method)
    if match_blur:
        photo, _ = blur_match(photo, render, method=method)
    flow_px = METHODS[method](_luminance(render), _luminance(photo))
    if not np.isfinite(flow_px).all():
        raise ValueError(f"{method} gave a flow that is not finite")
    return flow_px


def blur_match(photo, render, *, method=DEFAULT):
    """The photo [h, w, 3] as blurred as the render, and the blur's sigma_px.

    A blurred render against a sharp photo looks like motion: with a true flow of
    zero DIS invents 0.1 to 0.4 px. sigma minimises the squared difference between
    the render and the blurred photo *after* a first flow has aligned them: without
    it the misalignment itself would be taken for blur.
    """
    _check(render, photo, method)
    first_px = METHODS[method](_luminance(render), _luminance(photo))
    aligned = _luminance(warp.warp(photo, first_px))
    target = _luminance(render).astype(np.float32)
    inside = warp.in_frame(first_px)
    residuals = [
        np.square(_blur(aligned, sigma_px) - target)[inside].mean()
        if inside.any()
        else 0.0
        for sigma_px in SIGMAS_PX
    ]
    sigma_px = SIGMAS_PX[int(np.argmin(residuals))]
    return _blur(photo, sigma_px), sigma_px


def _blur(image, sigma_px):
    return cv2.GaussianBlur(image, (0, 0), sigma_px) if sigma_px > 0 else image


def _luminance(image):
    return cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)


def _check(render, photo, method):
    if method not in METHODS:
        raise ValueError(f"flow method {method!r} is not one of {', '.join(METHODS)}")
    for name, image in (("render", render), ("photo", photo)):
        warp.check_image(image, name)
    if render.shape != photo.shape:
        raise ValueError(
            "render and photo differ in size: "
            f"{_size(render)} against {_size(photo)} pixels"
        )
    if min(render.shape[:2]) < MIN_SIDE_PX:
        raise ValueError(
            f"images of {_size(render)} pixels are too small for optical flow: "
            f"each side must have at least {MIN_SIDE_PX}"
        )


def _size(image):
    return f"{image.shape[1]}x{image.shape[0]}"
