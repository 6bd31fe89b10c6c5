"""Optical flow from a render to a photo.

Notation: `flow_px` [h, w, 2] float32, x then y in pixels, with
render(x) ~ photo(x + flow_px(x)); images [h, w, 3] uint8 RGB; `sigma_px` standard
deviation of a Gaussian blur. x is an array index: pixel centres are integers here.
"""

import cv2
import numpy as np

from flow.estimation import blur, estimators
from flow.warping import warp

METHODS = estimators.METHODS
DEFAULT = "deepflow"


def estimate(render, photo, *, method=DEFAULT, match_blur=False):
    """Flow [h, w, 2] float32 with render(x) ~ photo(x + flow(x)).

    render, photo: [h, w, 3] uint8 RGB of one size, no side under the method's
    smallest. method: a key of METHODS. match_blur: blur the photo as the render is
    before the flow (see `blur_match`). Identical images give exactly zero. Raises
    ValueError where the images are no such pair, and where the method has no finite
    answer (SimpleFlow on flat parts).
    """
    _check(render, photo, method)
    if match_blur:
        photo, _ = blur_match(photo, render, method=method)
    return _calculate(render, photo, method)


def blur_match(photo, render, *, method=DEFAULT, blur_by=None):
    """The photo [h, w, 3] as blurred as the render, and the blur's sigma_px.

    A blurred render against a sharp photo looks like motion: with a true flow of
    zero DIS invents 0.1 to 0.4 px. See `blur.match`; the first flow is by blur_by, or
    by the method where that is None.
    """
    first = blur_by or method
    _check(render, photo, first)
    return blur.match(photo, render, _calculate(render, photo, first))


def check_pair(render, photo):
    """Raise ValueError unless both are [h, w, 3] uint8 of one size."""
    for name, image in (("render", render), ("photo", photo)):
        warp.check_image(image, name)
    if render.shape != photo.shape:
        raise ValueError(
            "render and photo differ in size: "
            f"{_size(render)} against {_size(photo)} pixels"
        )


def _calculate(render, photo, method):
    # Of all estimators Farneback alone finds motion between equal images, up to
    # 0.15 px near borders; for the others this only saves the time.
    if np.array_equal(render, photo):
        return np.zeros((*render.shape[:2], 2), np.float32)
    try:
        flow_px = METHODS[method].calculate(render, photo)
    except cv2.error as error:
        reason = str(error).strip().splitlines()[-1]
        raise ValueError(f"{method} failed in OpenCV: {reason}") from error
    if not np.isfinite(flow_px).all():
        raise ValueError(f"{method} gave a flow that is not finite")
    return flow_px


def _check(render, photo, method):
    if method in estimators.LEFT_OUT:
        reason = estimators.LEFT_OUT[method]
        raise ValueError(f"flow method {method!r} is left out: {reason}")
    if method not in METHODS:
        raise ValueError(f"flow method {method!r} is not one of {', '.join(METHODS)}")
    check_pair(render, photo)
    least_px = METHODS[method].min_side_px
    if min(render.shape[:2]) < least_px:
        raise ValueError(
            f"images of {_size(render)} pixels are too small for optical flow by "
            f"{method}: each side must have at least {least_px}"
        )


def _size(image):
    return f"{image.shape[1]}x{image.shape[0]}"
