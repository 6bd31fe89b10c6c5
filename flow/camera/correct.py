"""The corrections of a scene's cameras by the views' flows.

Each view's flow, from a render to its photo, gives a motion of its camera (see `fit`).
All views together show which motions can be trusted, and whether the focal length,
which the views share, is wrong. A camera without a trusted motion stays where it is.
"""

from typing import NamedTuple

import numpy as np

from flow.camera import fit as camera_fit
from flow.camera import motion as camera_motion

# A camera stays where a smaller share of the view's pixels has a flow and a depth.
LEAST_VALID_SHARE = 0.05
# A camera stays where its fit leaves more noise than this many times the views' median
# noise, and more than this standard deviation in px.
NOISE_RATIO, LEAST_NOISE_PX = 4.0, 0.5
# A camera stays where its motion is longer than this many times the views' median
# motion, and longer than this in px.
LENGTH_RATIO, LEAST_LENGTH_PX = 10.0, 3.0
# All cameras stay where the median motion is shorter: it is then the estimator's error.
# With true poses this error is 0.05 to 0.08 px, and cameras moved by it made the next
# round blurrier.
LEAST_MEDIAN_PX = 0.1
# A longer motion is no estimator's error: this camera moves even if the median motion
# is below LEAST_MEDIAN_PX. With true poses and moving objects none of 42 views had a
# motion longer than 0.20 px.
CLEAR_PX = 0.5
# The focal length changes where the views' median zoom is more than this many standard
# errors from 0. Otherwise the views disagree, and the lens is not the cause.
ZOOM_ERRORS = 4.0
# Of a normal distribution: standard deviation over median absolute deviation, and
# standard error of the median over that of the mean.
MAD_SIGMAS, MEDIAN_ERRORS = 1.4826, 1.2533
# Fewer views may agree on a zoom by chance.
LEAST_VIEWS = 3


class View(NamedTuple):
    """The flow and the depth of a view, by which its camera is corrected.

    flow_px [h, w, 2], valid [h, w]: from its render to its photo; pixtocam [3, 3];
    depth [h, w] of the render along the optical axis.
    """

    flow_px: np.ndarray
    valid: np.ndarray
    pixtocam: np.ndarray
    depth: np.ndarray


class Correction(NamedTuple):
    """How a camera moves, in its own frame and in units of the depth.

    length_px: median length of the flow that the motion causes. noise_px: standard
    deviation of the rest of the flow. valid_share: share of pixels with a flow and a
    depth. depth: median depth of these pixels, or 1. left_alone: the reason why the
    camera stays (motion is then `STILL`), "" for a camera that moves. trusted: False
    where too few pixels have a flow, or noise or motion is an outlier among the views.
    """

    motion: camera_motion.Motion
    length_px: float
    noise_px: float
    valid_share: float
    depth: float
    left_alone: str
    trusted: bool = True


def corrections(
    views,
    *,
    least_px=LEAST_MEDIAN_PX,
    zooms=True,
    log_focal=0.0,
    most_pixels=camera_fit.MAX_PIXELS,
) -> list[Correction]:
    """The `Correction` of each view, in the order of the views.

    views: a function that gives an iterator of `View`; with `zooms` it is called twice,
    else once. All cameras that move share one log_focal. least_px: where the median
    motion is shorter, only motions beyond CLEAR_PX are kept. zooms: whether the focal
    length may change; if not, log_focal is the zoom that is known. most_pixels: the fit
    samples about so many pixels of a view.
    Raises ValueError where the shapes of a view's arrays do not match.
    """
    size = {"most_pixels": most_pixels}
    if zooms:
        fits = [_fitted(view, log_focal=None, **size) for view in views()]
        log_focal = shared_zoom(
            [fit.motion.log_focal for fit in fits if not fit.left_alone]
        )
    corrected = [_fitted(view, log_focal=log_focal, **size) for view in views()]
    kept = [correction for correction in corrected if not correction.left_alone]
    usual = {
        name: float(np.median([getattr(correction, name) for correction in kept]))
        for name in (("noise_px", "length_px") if kept else ())
    }
    if kept and usual["length_px"] < least_px:
        reason = (
            f"the median view would move by {usual['length_px']:.2f} px, and under "
            f"{least_px:g} px that is the flow's error"
        )
        corrected = [
            c if c.left_alone or c.length_px > CLEAR_PX else left_alone(c, reason)
            for c in corrected
        ]
    return [c if c.left_alone else _with_others(c, **usual) for c in corrected]


def shared_zoom(log_focals):
    """The views' median log_focal; 0 where they disagree, or are under LEAST_VIEWS."""
    if len(log_focals) < LEAST_VIEWS:
        return 0.0
    median = float(np.median(log_focals))
    spread = MAD_SIGMAS * np.median(np.abs(np.asarray(log_focals) - median))
    error = MEDIAN_ERRORS * spread / np.sqrt(len(log_focals))
    return median if abs(median) > ZOOM_ERRORS * error else 0.0


def _fitted(view: View, **options) -> Correction:
    """The correction by one view's flow alone; options: of `camera_fit.split`."""
    fit = camera_fit.split(*view, **options)
    lengths_px = np.linalg.norm(fit.camera_px[fit.valid], axis=-1)
    share = float(fit.valid.mean())
    near = view.depth[fit.valid & np.isfinite(view.depth)]
    reason = ""
    if fit.pixels == 0:
        reason = f"only {fit.valid.sum()} pixels have a flow and a depth"
    elif share < LEAST_VALID_SHARE:
        reason = f"only {share:.1%} of its pixels have a flow and a depth"
    correction = Correction(
        motion=fit.motion,
        length_px=float(np.median(lengths_px)) if len(lengths_px) else 0.0,
        noise_px=fit.noise_px,
        valid_share=share,
        depth=float(np.median(near)) if len(near) else 1.0,
        left_alone="",
    )
    return _mistrusted(correction, reason) if reason else correction


def _with_others(correction: Correction, *, noise_px, length_px) -> Correction:
    """The correction; not trusted where its noise or length is an outlier."""
    if correction.noise_px > max(LEAST_NOISE_PX, NOISE_RATIO * noise_px):
        return _mistrusted(
            correction,
            f"no camera explains its flow: {correction.noise_px:.2f} px remain, "
            f"{noise_px:.2f} px in the median view",
        )
    if correction.length_px > max(LEAST_LENGTH_PX, LENGTH_RATIO * length_px):
        return _mistrusted(
            correction,
            f"it would move by {correction.length_px:.1f} px, the median view by "
            f"{length_px:.2f} px",
        )
    return correction


def _mistrusted(correction: Correction, reason) -> Correction:
    return left_alone(correction, reason)._replace(trusted=False)


def left_alone(correction: Correction, reason) -> Correction:
    """The correction with no motion, for a camera that stays; reason: a text."""
    return correction._replace(
        motion=camera_motion.STILL, length_px=0.0, left_alone=reason
    )
