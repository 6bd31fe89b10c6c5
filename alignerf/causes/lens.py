"""The lens is not the one that the cameras say: all photos are changed alike.

Matches tell it where the poses, held as they are, fit with another lens. Without them
the shift or the bend that all flows share tells it, of which a model absorbs most.
"""

from alignerf.causes import base, shift

# Common to all views' flows, and beyond so many standard errors. A model absorbs nine
# tenths of a shift.
SHIFT_PX, BEND_PX, LENS_ERRORS = 0.045, 0.08, 3.0
# And most of what photos are apart by.
SHIFT_FRACTION = 0.5
# By matches, in px of the photo at its corner; a focal length by as much.
LENS_PX = 1.0
# Of what any correction takes from the matches' error: from here on the lens has a part
# in it, and the poses have none.
LENS_FRACTION, ALONE_FRACTION = 0.4, 0.57
# What right cameras leave of it in px of the photo, where no adjustment says so.
FLOOR_PX = 0.3
# A lens that is all has to gain so much in px of the photo, and may leave so much.
MIN_GAIN_PX, MAX_LEFT_PX = 0.02, 0.6
# What a wrong lens looks like in flows.
EXPLAINS = ("camera", "motion", "sparse")
SPOILS = "the lens is not the one that the cameras say"
CORRECTED = "train again with the corrected cameras: `{export}` writes them."


def fraction(e):
    """Of what a correction takes from the matches' error at most, the lens's part."""
    found = of_cameras(e)
    if not (found and found.changed):
        return 0.0
    least = min(found.after_px, e.matches.after_px if corrects(e) else FLOOR_PX)
    return (found.before_px - found.after_px) / max(found.before_px - least, 1e-9)


def of_cameras(e):
    """The `sfm.lens.Lens` of the cameras in use, input or adjusted ones; None."""
    return e.matches and (e.matches.left if e.matches.applied else e.matches.lens)


def by_matches(e):
    """The `sfm.lens.Lens` that matches ask for, by input or adjusted poses; None."""
    if fraction(e) >= LENS_FRACTION:
        return of_cameras(e)
    left = e.matches and e.matches.left
    return left if left and left.changed else None


def is_alone(e):
    """Whether the lens is all that matches have against the cameras."""
    found = of_cameras(e)
    if not found or fraction(e) < ALONE_FRACTION:
        return False
    gain_px = found.before_px - found.after_px
    return gain_px >= MIN_GAIN_PX and found.after_px <= MAX_LEFT_PX


def corrects(e):
    """Whether there are adjusted cameras besides those in use."""
    return e.matches.accepted and not e.matches.applied


def part_px(e, part):
    """By how much matches call a part of the lens off, in px of the photo; 0: not."""
    found = by_matches(e)
    if not (found and part in found.changed):
        return 0.0
    px = getattr(found, f"{part}_px", 0.0)
    if part == "focal":
        # At the middle of the left and the right edge.
        px = abs(found.focal_ratio - 1) * 0.5 * e.photo_width_px
    return px if px > LENS_PX else 0.0


def of_part(e, part, otherwise=None):
    """(px of the photo, whether it is sure) of a part that matches ask for; else None.

    otherwise: what flows say, (px of the training, whether it is sure) or None.
    """
    if px := part_px(e, part):
        return px / e.photo_px, px > 2 * LENS_PX and fraction(e) >= LENS_FRACTION
    return otherwise


def beyond_error(px, errors, limit_px):
    """(length, whether it is sure), of a length that views agree on; else None."""
    if px > limit_px and errors > LENS_ERRORS:
        return px, px > 2 * limit_px
    return None


def shifted(e):
    """All photos are shifted alike: the lens, or the origin of pixels."""
    by_flows = beyond_error(e.shift_px, e.shift_errors, SHIFT_PX)
    if e.shift_px < SHIFT_FRACTION * shift.flow_px(e):
        by_flows = None
    if e.matches and e.matches.lens and not e.judged:
        # Our trainings see the photos by the cameras that matches have tested.
        by_flows = None
    return of_part(e, "centre", by_flows)


def bent(e):
    """All photos are bent alike."""
    by_flows = beyond_error(e.distortion_px, e.distortion_errors, BEND_PX)
    if e.matches and e.matches.lens:
        by_flows = None
    return of_part(e, "distortion", by_flows)


def gauge(part, flow, limit):
    """(value, limit) of a gauge, in px of the training: by matches, else by flows."""

    def value(e):
        px = part_px(e, part)
        return px / e.photo_px if px else flow(e)

    def its_limit(e):
        return LENS_PX / e.photo_px if part_px(e, part) else limit(e)

    return {"value": value, "limit": its_limit}


def cause(part, flow=lambda e: 0.0, limit=lambda e: LENS_PX / e.photo_px, **more):
    """The record of a part of the lens."""
    decide = more.pop("decide", lambda e: of_part(e, part))
    return base.Cause(
        unit="px",
        scale=lambda e: e.photo_px,
        **gauge(part, flow, limit),
        decide=decide,
        explains=EXPLAINS,
        explains_now=is_alone,
        spoils=SPOILS,
        stands=lambda e: part_px(e, part) > 0,
        **more,
    )


SHIFT = cause(
    "centre",
    lambda e: e.shift_px,
    lambda e: SHIFT_PX,
    decide=shifted,
    name="lens_shift",
    order=(3, 6, 2),
    label="principal point",
    called="the principal point is {probably}off",
    sentence=lambda e, probably: (
        f"The principal point is {probably}off: matches between photos put it "
        f"{base.length(part_px(e, 'centre'))} away."
        if part_px(e, "centre")
        else f"All photos are {probably}misaligned alike, by "
        f"{base.length(e.photo_px * e.shift_px)}: the principal point is wrong, or "
        "pixel centers are half a pixel off."
    ),
    advice="check the pixel centers and principal point of the input cameras.",
    advice_external=lambda e, gains: (
        CORRECTED
        if part_px(e, "centre") and corrects(e)
        else "check the pixel centers and principal point that your program had: a "
        "wrong origin of pixels misaligns by half a pixel."
    ),
)
DISTORTION = cause(
    "distortion",
    lambda e: e.distortion_px,
    lambda e: BEND_PX,
    decide=bent,
    name="lens_distortion",
    order=(4, 7, 3),
    label="lens distortion",
    called="the lens distortion is {probably}wrong",
    sentence="All photos are {probably}distorted alike, by {px} at the corners: the "
    "lens distortion is wrong.",
    advice="calibrate the lens again, or let COLMAP estimate it.",
    advice_external="calibrate the lens again, or undistort the photos first.",
)
FOCAL = cause(
    "focal",
    name="focal",
    order=(14, 6.5, 2.5),
    label="focal length",
    looked_for=lambda e: bool(e.matches and e.matches.lens),
    called="the focal length is {probably}off",
    sentence=lambda e, probably: (
        f"The focal length is {probably}off: matches between photos fit "
        f"{by_matches(e).focal_ratio:.4f} times the one in use."
    ),
    advice=lambda e, gains: (
        f"multiply the focal length by {by_matches(e).focal_ratio:.4f}, or "
        "adjust the cameras before training: `poses: adjusted` in the config."
    ),
    advice_external=lambda e, gains: (
        CORRECTED
        if corrects(e)
        else f"multiply the focal length by {by_matches(e).focal_ratio:.4f}, and "
        "train again."
    ),
)
SHUTTER = cause(
    "shutter",
    name="rolling_shutter",
    order=(15, 7.5, 3.5),
    label="rolling shutter",
    looked_for=lambda e: bool(e.matches and e.matches.lens),
    called="a rolling shutter {probably}skews the photos",
    sentence="A rolling shutter {probably}skews the photos: by {px} from the first row "
    "to the last of the median photo, with the camera's motion.",
    advice="move the camera slower, or take photos instead of a video. Nothing here "
    "corrects a rolling shutter.",
    advice_external="move the camera slower, or take photos instead of a video; some "
    "programs model a rolling shutter.",
)
CAUSE = [SHIFT, DISTORTION, FOCAL, SHUTTER]
