"""How much of a flow a camera explains: one view's pose error, fitted to its flow.

Notation: `flow_px` [h, w, 2] with render(x) ~ photo(x + flow(x)), x then y; `valid`
[h, w]; `pixtocam` [3, 3] inverse intrinsics, pixel centres at +0.5; `depth` [h, w]
along the optical axis. The photo's camera is the moved one (see `camera_motion`).
Robust by graduated non-convexity (Yang et al. 2020, arXiv 1909.08605) on Geman and
McClure's loss.
"""

from typing import NamedTuple

import numpy as np

from flow.camera import motion as camera_motion

# Fewer pixels are no view: the camera is then left where it is.
MIN_PIXELS = 64
# A regular sample of larger images: neighbours of a flow say the same.
MAX_PIXELS = 10_000
# Beyond this many standard deviations a pixel does not move with the camera.
OUTLIER_SIGMAS = 3.0
# No flow is known better than this standard deviation of a component.
MIN_NOISE_PX = 0.02
# Quantiles of the length of a two-dimensional normal error, in standard deviations:
# half of the pixels say how large it is, a quarter still does while the fit is far
# off and half of the image moves on its own.
MEDIAN, QUARTER = (0.5, 1.1774), (0.25, 0.7585)
# What a motion costs that the flow does not ask for, against the fit of all pixels,
# both in px^2. Of motions that look alike (a turn and a sidestep before distant or
# flat things, a step and a zoom) the turn is taken: it needs no depth.
RIDGE = np.array([1e-6] * 3 + [1e-4] * 3 + [1e-4])
# The loss starts convex and narrows by this factor, some steps at each width.
NARROWING = 0.7
STEPS_PER_WIDTH = 2
MAX_STEPS = 100
CONVERGED_PX = 1e-4
# A turn by more radians at once is an artefact of linearity.
LARGEST_TURN = 0.2


class Fit(NamedTuple):
    """A flow split in two; camera_px + remainder_px is the flow.

    valid [h, w]: the flow's, where the depth is known. noise_px: standard deviation
    of a component of the remainder, robustly. moved [h, w]: valid pixels whose
    remainder is beyond OUTLIER_SIGMAS of it. pixels: how many were fitted, 0 where
    there were too few, and the camera was left where it is.
    """

    motion: camera_motion.Motion
    camera_px: np.ndarray  # [h, w, 2] float32
    remainder_px: np.ndarray  # [h, w, 2] float32
    valid: np.ndarray  # [h, w] bool
    moved: np.ndarray  # [h, w] bool
    noise_px: float
    pixels: int


class Found(NamedTuple):
    """The motion that a view's flow says, and the pixels that it was found by.

    points: of all pixels; sample [h, w]: those that were fitted, `pixels` in number, 0
    where there were too few; valid as of `Fit`.
    """

    motion: camera_motion.Motion
    points: camera_motion.Points
    sample: np.ndarray  # [h, w] bool
    valid: np.ndarray  # [h, w] bool
    pixels: int


def split(
    flow_px, valid, pixtocam, depth=None, *, log_focal=None, max_pixels=MAX_PIXELS
) -> Fit:
    """Split a flow [h, w, 2] into what a moved camera explains, and the rest.

    depth [h, w]: not positive or NaN is unknown, infinite is far away; None:
    everything is far away, and only a turn and a zoom are fitted. log_focal: a zoom
    that is known, and not fitted. max_pixels: about so many are fitted. Always finite;
    raises ValueError where shapes do not fit or pixtocam is singular.
    """
    found = motion_of(
        *(flow_px, valid, pixtocam, depth),
        log_focal=log_focal,
        max_pixels=max_pixels,
    )
    camera_px = camera_motion.flow(found.motion, found.points)
    remainder_px = flow_px - camera_px
    length_px = np.linalg.norm(remainder_px, axis=-1)
    sampled_px = length_px[found.sample]
    noise_px = _noise_px(sampled_px, *MEDIAN) if len(sampled_px) else 0.0
    min_px = OUTLIER_SIGMAS * max(noise_px, MIN_NOISE_PX)
    return Fit(
        motion=found.motion,
        camera_px=camera_px.astype(np.float32),
        remainder_px=remainder_px.astype(np.float32),
        valid=found.valid,
        moved=found.valid & (length_px > min_px),
        noise_px=noise_px,
        pixels=found.pixels,
    )


def motion_of(
    flow_px, valid, pixtocam, depth=None, *, log_focal=None, max_pixels=MAX_PIXELS
) -> Found:
    """The motion alone, without what it makes of each pixel; arguments of `split`."""
    valid, depth = _checked(flow_px, valid, pixtocam, depth)
    points = camera_motion.points_of(pixtocam, depth)
    sample = sample_of(valid, max_pixels)
    pixels = int(sample.sum())
    motion = camera_motion.STILL._replace(log_focal=log_focal or 0.0)
    if pixels < MIN_PIXELS:
        return Found(motion, points, sample, valid, 0)
    chosen = points._replace(rays=points.rays[sample], rho=points.rho[sample])
    target_px = np.asarray(flow_px[sample], dtype=np.float64)
    motion = fit(target_px, chosen, log_focal=log_focal)
    return Found(motion, points, sample, valid, pixels)


def _checked(flow_px, valid, pixtocam, depth):
    """(valid where the depth is known too, depth), both [h, w]."""
    shape = valid.shape
    if valid.dtype != bool or flow_px.shape != (*shape, 2):
        raise ValueError(f"flow {flow_px.shape} and valid {shape} do not fit")
    if np.shape(pixtocam) != (3, 3) or not np.isfinite(pixtocam).all():
        raise ValueError("pixtocam is not a finite 3x3 matrix")
    if np.linalg.det(pixtocam) == 0:
        raise ValueError("pixtocam is singular")
    depth = np.full(shape, np.inf) if depth is None else np.asarray(depth)
    if depth.shape != shape:
        raise ValueError(f"depth {depth.shape} does not fit the flow {shape}")
    known = (depth > 0) & np.isfinite(flow_px).all(axis=-1)
    return valid & known, depth


def sample_of(usable, most):
    """At most about so many of the usable pixels, on a regular grid."""
    stride = int(np.ceil(np.sqrt(max(usable.sum() / most, 1))))
    chosen = np.zeros_like(usable)
    chosen[::stride, ::stride] = usable[::stride, ::stride]
    return chosen


def fit(flow_px, points, *, log_focal=None):
    """The motion that most pixels agree on: flow_px [n, 2]; see `split`."""
    unit = units(points)
    motion = camera_motion.STILL
    if log_focal is not None:
        motion, unit[-1] = motion._replace(log_focal=log_focal), 0.0
    still_px = camera_motion.pixels(camera_motion.STILL, points)
    q, residual_px = _left(motion, flow_px, points, still_px)
    length_px = np.linalg.norm(residual_px, axis=-1)
    width_px = max(2 * np.percentile(length_px, 95), OUTLIER_SIGMAS * MIN_NOISE_PX)
    for number in range(MAX_STEPS):
        by = camera_motion.jacobian(motion, points, q)
        motion, change_px = _step(motion, width_px, unit, by, residual_px)
        q, residual_px = _left(motion, flow_px, points, still_px)
        if number % STEPS_PER_WIDTH:
            continue
        # The noise falls with the fit: narrow until both have come to rest.
        noise_px = _noise_px(np.linalg.norm(residual_px, axis=-1), *QUARTER)
        min_px = OUTLIER_SIGMAS * max(noise_px, MIN_NOISE_PX)
        narrower_px = max(min_px, NARROWING * width_px)
        if narrower_px > 0.99 * width_px and change_px < CONVERGED_PX:
            break
        width_px = min(width_px, narrower_px)
    return motion


def _left(motion, flow_px, points, still_px):
    """(directions [n, 3], what the motion leaves of the flow [n, 2] in px).

    still_px: the pixels without motion, which all motions of a fit share.
    """
    q = camera_motion.directions(motion, points)
    return q, flow_px - (camera_motion.pixels(motion, points, q) - still_px)


def units(points):
    """A change [7] of each parameter that makes a flow of 1 px, root mean square.

    Zero for a parameter without effect, as a step is where all is infinitely far.
    """
    by = camera_motion.jacobian(camera_motion.STILL, points)
    mean = (by**2).sum(axis=1).mean(axis=0)
    size_px = np.sqrt(mean)
    return np.where(size_px > 1e-9, 1 / np.maximum(size_px, 1e-9), 0.0)


def _noise_px(length_px, share, sigmas):
    """Standard deviation of a component, from a quantile of the errors' length."""
    return float(np.quantile(length_px, share)) / sigmas


def _step(motion, width_px, unit, by, residual):
    """One step of iteratively reweighted Gauss-Newton; (motion, largest change in px).

    The loss r^2 / (1 + r^2 / width^2), whose weight falls with the fourth power of
    the residual r [n, 2], plus the ridge on the whole motion. by [n, 2, 7]: the
    derivative at this motion.
    """
    weight = 1 / (1 + (residual**2).sum(axis=-1) / width_px**2) ** 2
    by = (by * unit).reshape(-1, 7)
    weighted = by * np.repeat(weight / max(weight.sum(), 1e-12), 2)[:, None]
    normal = weighted.T @ by
    now = camera_motion.parameters(motion)
    now = np.divide(now, unit, out=np.zeros(7), where=unit > 0)
    right = weighted.T @ residual.ravel() - RIDGE * now
    change = np.linalg.solve(normal + np.diag(RIDGE), right)
    turn = np.linalg.norm((change * unit)[:3])
    change *= min(1.0, LARGEST_TURN / max(turn, 1e-12))
    return camera_motion.moved(motion, change * unit), float(np.abs(change).max())
