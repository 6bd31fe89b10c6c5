"""The corrections of a scene's cameras by the views' flows.

Each view's flow, from a render to its photo, gives a motion of its camera (see `fit`).
All views together show which motions can be trusted, and whether the focal length,
which the views share, is wrong. A camera without a trusted motion stays where it is.
"""

from typing import NamedTuple

import numpy as np

from alignerf.io import machine
from flow.camera import fit as camera_fit
from flow.camera import motion as camera_motion

# A camera stays where a smaller share of the view's pixels has a flow and a depth.
MIN_VALID_FRACTION = 0.05
# A camera stays where its fit leaves more noise than this many times the views' median
# noise, and more than this standard deviation in px.
NOISE_RATIO, MIN_NOISE_PX = 4.0, 0.5
# A camera stays where its motion is longer than this many times the views' median
# motion, and longer than this in px.
LENGTH_RATIO, MIN_LENGTH_PX = 10.0, 3.0
# All cameras stay where the median motion is shorter: it is then the estimator's error.
# With true poses this error is 0.05 to 0.08 px, and cameras moved by it made the next
# round blurrier.
MIN_MEDIAN_PX = 0.1
# A longer motion is no estimator's error: this camera moves even if the median motion
# is below MIN_MEDIAN_PX. With true poses and moving objects none of 42 views had a
# motion longer than 0.20 px.
CLEAR_PX = 0.5
# The focal length changes where the views' median zoom is more than this many standard
# errors from 0. Otherwise the views disagree, and the lens is not the cause.
ZOOM_ERRORS = 4.0
# Of a normal distribution: standard deviation over median absolute deviation, and
# standard error of the median over that of the mean.
MAD_SIGMAS, MEDIAN_ERRORS = 1.4826, 1.2533
# Fewer views may agree on a zoom by chance.
MIN_VIEWS = 3


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
    deviation of the rest of the flow. valid_fraction: share of pixels with a flow and a
    depth. depth: median depth of these pixels, or 1. left_alone: the reason why the
    camera stays (motion is then `STILL`), "" for a camera that moves. trusted: False
    where too few pixels have a flow, or noise or motion is an outlier among the views.
    """

    motion: camera_motion.Motion
    length_px: float
    noise_px: float
    valid_fraction: float
    depth: float
    left_alone: str
    trusted: bool = True


def corrections(
    views,
    *,
    min_px=MIN_MEDIAN_PX,
    zooms=True,
    log_focal=0.0,
    max_pixels=camera_fit.MAX_PIXELS,
    threads=1,
) -> list[Correction]:
    """The `Correction` of each view, in the order of the views.

    views: a function for each view that gives its `View`; with `zooms` it is called
    twice, else once, in one of so many threads. All cameras that move share one
    log_focal. min_px: where the median motion is shorter, only motions beyond
    CLEAR_PX are kept. zooms: whether the focal length may change; if not, log_focal is
    the zoom that is known. max_pixels: the fit samples about so many pixels of a view.
    Raises ValueError where the shapes of a view's arrays do not match.
    """
    size = {"max_pixels": max_pixels}

    def in_threads(function):
        return list(machine.map_in_threads(function, views, threads=threads))

    if zooms:
        found = in_threads(lambda view: _zoom(view(), **size))
        log_focal = shared_zoom([zoom for zoom in found if zoom is not None])
    corrected = in_threads(lambda view: _fitted(view(), log_focal=log_focal, **size))
    kept = [correction for correction in corrected if not correction.left_alone]
    usual = {
        name: float(np.median([getattr(correction, name) for correction in kept]))
        for name in (("noise_px", "length_px") if kept else ())
    }
    if kept and usual["length_px"] < min_px:
        reason = (
            f"the median view would move by {usual['length_px']:.2f} px, and under "
            f"{min_px:g} px that is the flow's error"
        )
        corrected = [
            c if c.left_alone or c.length_px > CLEAR_PX else left_alone(c, reason)
            for c in corrected
        ]
    return [c if c.left_alone else _with_others(c, **usual) for c in corrected]


def shared_zoom(log_focals):
    """The views' median log_focal; 0 where they disagree, or are under MIN_VIEWS."""
    if len(log_focals) < MIN_VIEWS:
        return 0.0
    median = float(np.median(log_focals))
    spread = MAD_SIGMAS * np.median(np.abs(np.asarray(log_focals) - median))
    error = MEDIAN_ERRORS * spread / np.sqrt(len(log_focals))
    return median if abs(median) > ZOOM_ERRORS * error else 0.0


def _zoom(view: View, **options):
    """The log_focal that fits a view best; None where too little of it has a flow."""
    found = camera_fit.motion_of(*view, **options)
    return None if _too_few(found.valid, found.pixels) else found.motion.log_focal


def _too_few(valid, pixels):
    """The reason why so few pixels say nothing of a camera, else ""."""
    if pixels == 0:
        return f"only {valid.sum()} pixels have a flow and a depth"
    if valid.mean() < MIN_VALID_FRACTION:
        return f"only {valid.mean():.1%} of its pixels have a flow and a depth"
    return ""


def _fitted(view: View, **options) -> Correction:
    """The correction by one view's flow alone; options: of `camera_fit.split`."""
    fit = camera_fit.split(*view, **options)
    lengths_px = np.linalg.norm(fit.camera_px[fit.valid], axis=-1)
    near = view.depth[fit.valid & np.isfinite(view.depth)]
    reason = _too_few(fit.valid, fit.pixels)
    correction = Correction(
        motion=fit.motion,
        length_px=float(np.median(lengths_px)) if len(lengths_px) else 0.0,
        noise_px=fit.noise_px,
        valid_fraction=float(fit.valid.mean()),
        depth=float(np.median(near)) if len(near) else 1.0,
        left_alone="",
    )
    return _mistrusted(correction, reason) if reason else correction


def _with_others(correction: Correction, *, noise_px, length_px) -> Correction:
    """The correction; not trusted where its noise or length is an outlier."""
    if correction.noise_px > max(MIN_NOISE_PX, NOISE_RATIO * noise_px):
        return _mistrusted(
            correction,
            f"no camera explains its flow: {correction.noise_px:.2f} px remain, "
            f"{noise_px:.2f} px in the median view",
        )
    if correction.length_px > max(MIN_LENGTH_PX, LENGTH_RATIO * length_px):
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
