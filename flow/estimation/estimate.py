"""Optical flow from a render to a photo.

Notation: `flow_px` [h, w, 2] float32, x then y in pixels, with
render(x) ~ photo(x + flow_px(x)); images [h, w, 3] uint8 RGB; `sigma_px` standard
deviation of a Gaussian blur. x is an array index: pixel centres are integers here.
"""

import argparse

import cv2
import numpy as np

from flow.estimation import estimators
from flow.warping import warp

METHODS = estimators.METHODS
DEFAULT = "deepflow"
# A render of a misaligned scene is rarely blurrier than 3 pixels; finer steps than
# a quarter of a pixel did not change the flow.
SIGMAS_PX = (0.0, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0)


def estimate(render, photo, *, method=DEFAULT, match_blur=False):
    """Flow [h, w, 2] float32 with render(x) ~ photo(x + flow(x)).

    render, photo: [h, w, 3] uint8 RGB of one size, no side under the method's
    smallest. method: a key of METHODS. match_blur: blur the photo as the render is
    before the flow (see `blur_match`). Identical images give exactly zero. Raises
    ValueError where the images are no such pair, and where the method has no finite
    answer.
    """
    _check(render, photo, method)
    if match_blur:
        photo, _ = blur_match(photo, render, method=method)
    return _calculate(render, photo, method)


def blur_match(photo, render, *, method=DEFAULT, blur_by=None):
    """The photo [h, w, 3] as blurred as the render, and the blur's sigma_px.

    A blurred render against a sharp photo looks like motion: with a true flow of
    zero DIS invents 0.1 to 0.4 px. The first flow is by blur_by, or by the
    method where that is None; see `blurred_alike`.
    """
    first = blur_by or method
    _check(render, photo, first)
    return blurred_alike(photo, render, _calculate(render, photo, first))


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
    # This saves the time.
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
    if method not in METHODS:
        raise ValueError(f"flow method {method!r} is not one of {', '.join(METHODS)}")
    check_pair(render, photo)
    min_px = METHODS[method].min_side_px
    if min(render.shape[:2]) < min_px:
        raise ValueError(
            f"images of {_size(render)} pixels are too small for optical flow by "
            f"{method}: each side must have at least {min_px}"
        )


def _size(image):
    return f"{image.shape[1]}x{image.shape[0]}"


def blurred_alike(photo, render, first_px):
    """The photo [h, w, 3] as blurred as the render, and the blur's sigma_px.

    first_px: a first flow. sigma minimises the squared difference of luminance
    between the render and the blurred photo *after* that flow has aligned them:
    without it the misalignment itself would be taken for blur. One sigma for the
    image: a map of it, smooth over 12 to 48 px, changed the flow's error on renders
    of a trained model by less than 1 %, mostly for the worse.
    """
    aligned = cv2.cvtColor(warp.warp(photo, first_px), cv2.COLOR_RGB2GRAY)
    target = cv2.cvtColor(np.ascontiguousarray(render), cv2.COLOR_RGB2GRAY)
    target = target.astype(np.float32)
    inside = warp.in_frame(first_px)
    residuals = [
        np.square(blur(aligned, sigma_px) - target)[inside].mean()
        if inside.any()
        else 0.0
        for sigma_px in SIGMAS_PX
    ]
    sigma_px = SIGMAS_PX[int(np.argmin(residuals))]
    return blur(photo, sigma_px), sigma_px


def blur(image, sigma_px):
    """The image after a Gaussian of sigma_px; at 0 the image itself."""
    return cv2.GaussianBlur(image, (0, 0), sigma_px) if sigma_px > 0 else image


def find_pairs(renders, photos):
    """[(view, render's path, photo's path)] of every render, in the order of names.

    renders, photos: folders of <view>.png. Raises ValueError naming the folder or the
    photo that is missing.
    """
    for folder in (renders, photos):
        if not folder.is_dir():
            raise ValueError(f"{folder}: no such folder")
    views = sorted(path.stem for path in renders.glob("*.png"))
    if not views:
        raise ValueError(f"{renders}: no renders (*.png) to align")
    pairs = [(v, renders / f"{v}.png", photos / f"{v}.png") for v in views]
    for _, render_path, photo_path in pairs:
        if not photo_path.is_file():
            raise ValueError(f"{photo_path}: no photo for render {render_path}")
    return pairs


def flow_and_validity(
    render,
    photo,
    *,
    method=DEFAULT,
    match_blur=True,
    blur_by=None,
    tolerance_px=1.0,
    back=None,
):
    """(flow_px [h, w, 2], valid [h, w], sigma_px of the photo's blur before the flow).

    Valid: in frame, where the flow and that from photo to render agree to
    tolerance_px. blur_by: as of `blur_match`. back: the estimator of the flow
    from photo to render, which only checks; None: the same.
    """
    sigma_px, forward_px = 0.0, None
    if match_blur:
        first = blur_by or method
        first_px = estimate(render, photo, method=first)
        photo, sigma_px = blurred_alike(photo, render, first_px)
        # The first flow of an unchanged photo is the flow.
        forward_px = first_px if (sigma_px, first) == (0, method) else None
    if forward_px is None:
        forward_px = estimate(render, photo, method=method)
    backward_px = estimate(photo, render, method=back or method)
    valid = warp.consistent(forward_px, backward_px, tolerance_px=tolerance_px)
    return forward_px, valid, sigma_px


# The settings of the flow on a command line.
OPTIONS = {
    "[method]": ("estimator", {"choices": METHODS, "default": DEFAULT}),
    "[match-blur]": (
        "blur the photo as the render is, for the flow only",
        {"action": argparse.BooleanOptionalAction, "default": True},
    ),
    "[blur-by]": ("estimator by which it is found", {"choices": METHODS}),
    "[tolerance-px]": ("of forth and back", 1.0),
}
