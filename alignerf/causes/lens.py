"""All photos are shifted alike, or bent alike: principal point and lens."""

from alignerf.causes import base

# Common to all views' flows, and beyond so many standard errors. A model absorbs nine
# tenths of a shift.
SHIFT_PX, BEND_PX, LENS_ERRORS = 0.045, 0.08, 3.0


def beyond_error(px, errors, limit_px):
    """(length, whether it is sure), of a length that views agree on; else None."""
    if px > limit_px and errors > LENS_ERRORS:
        return px, px > 2 * limit_px
    return None


SHIFT = base.Cause(
    name="lens_shift",
    order=(3, 6, 2),
    label="principal point",
    unit="px",
    scale=lambda e: e.photo_px,
    value=lambda e: e.shift_px,
    limit=lambda e: SHIFT_PX,
    decide=lambda e: beyond_error(e.shift_px, e.shift_errors, SHIFT_PX),
    by_flow=True,
    called="the principal point is {probably}off",
    sentence="All photos are {probably}shifted alike, by {px}: the principal point is "
    "wrong, or pixel centres lie half a pixel off.",
    advice="check pixel centres and principal point of the given cameras.",
    advice_external="check pixel centres and principal point in what you gave the "
    "program: shifts of half a pixel come from a wrong origin of pixels.",
)
DISTORTION = base.Cause(
    name="lens_distortion",
    order=(4, 7, 3),
    label="lens distortion",
    unit="px",
    scale=lambda e: e.photo_px,
    value=lambda e: e.distortion_px,
    limit=lambda e: BEND_PX,
    decide=lambda e: beyond_error(e.distortion_px, e.distortion_errors, BEND_PX),
    by_flow=True,
    called="the lens is {probably}bent otherwise",
    sentence="All photos are {probably}bent alike, by {px} at the corners: the lens's "
    "distortion is wrong.",
    advice="calibrate the lens anew, or let COLMAP find it.",
    advice_external="calibrate the lens anew, or undistort the photos first.",
)
CAUSE = [SHIFT, DISTORTION]
