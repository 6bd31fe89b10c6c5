"""The lens is not the one that the cameras say: all photos are changed alike.

Matches tell it where the poses, held as they are, fit with another lens. Without them
the shift or the bend that all flows share tells it, of which a model absorbs most.
"""

import math

from alignerf.causes import base, exposure
from alignerf.causes.shared import misalignment

# Common to all views' flows, and beyond so many standard errors. A model absorbs nine
# tenths of a shift.
SHIFT_PX, BEND_PX, LENS_ERRORS = 0.045, 0.08, 3.0
# And most of what photos are apart by. Where matches deny a shift of the cameras, that
# of renders is all of it: 0.86 and more, a wrong lens or a curve of tone has 0.6.
SHIFT_FRACTION, SHIFT_ALONE = 0.5, 0.8
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
    if not (found and found.changed) or is_refused(e):
        return 0.0
    least = min(found.after_px, e.matches.after_px if corrects(e) else FLOOR_PX)
    return (found.before_px - found.after_px) / max(found.before_px - least, 1e-9)


def of_cameras(e):
    """The `sfm.lens.Lens` of the cameras in use, input or adjusted ones; None."""
    return e.matches and (e.matches.left if e.matches.applied else e.matches.lens)


def is_refused(e):
    """Whether poses explain what the lens would, and the adjustment kept the lens.

    In forward motion one stands for the other; poses then leave less of the error.
    """
    m, found = e.matches, of_cameras(e)
    kept = set(found.changed) <= set(m.kept)
    return kept and corrects(e) and m.after_px < found.after_px


def by_matches(e):
    """The `sfm.lens.Lens` that matches ask for, by input or adjusted poses; None."""
    if fraction(e) >= LENS_FRACTION:
        return of_cameras(e)
    left = e.matches and e.matches.left
    return left if left and {*left.changed} - {*e.matches.kept} else None


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


def is_asked(e):
    """Whether matches have been asked for the lens."""
    return bool(e.matches and (e.matches.lens or e.matches.left))


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


def of_part(e, part, by_flows=None):
    """The `base.Finding` of a part of the lens, in px of the photo.

    by_flows: what flows say of it, where matches do not ask for it.
    """
    found = by_flows or base.Finding(0.0, LENS_PX)
    if by_flows and is_disturbed(e, by_flows.value):
        found = found._replace(sure=None, detectable=False)
    if px := part_px(e, part):
        sure = px > 2 * LENS_PX and fraction(e) >= LENS_FRACTION
        found = base.Finding(px, LENS_PX, sure)
    return found._replace(explains=is_alone(e), stands=px > 0)


def is_disturbed(e, px):
    """Whether flows are moved by what moves them more than a wrong lens.

    px: what they say of it, of the photo. Of brightness they make no longer ones than
    are called aligned.
    """
    is_small = px < e.photo_px * misalignment.ALIGNED_PX
    off, short = misalignment.poses_off(e), misalignment.too_short(e)
    return off or short or (is_small and exposure.disturbs(e))


def find_shift(e):
    """All photos are shifted alike: the lens, or the origin of pixels."""
    px = e.photo_px * e.shift_px
    # Our trainings see the photos by the cameras that matches have tested; renders of
    # another program may still be drawn by others.
    least_px, fraction_of = SHIFT_PX, SHIFT_FRACTION
    if is_asked(e):
        least_px = misalignment.ALIGNED_PX if e.judged else math.inf
        fraction_of = SHIFT_ALONE
    is_all = e.shift_px >= max(fraction_of * misalignment.flow_px(e), least_px)
    where = is_all and e.shift_errors > LENS_ERRORS
    by_flows = base.beyond(px, e.photo_px * SHIFT_PX, where=where)
    found = of_part(e, "centre", by_flows)
    probably = base.probably(found.sure)
    if part_px(e, "centre"):
        said = f"The principal point is {probably}off: matches between photos put it "
        said += f"{base.length(found.value)} away"
        advice = CORRECTED if e.judged and corrects(e) else ""
        return found._replace(said=said, advice=advice)
    said = f"All photos are {probably}misaligned alike, by {base.length(px)}: the "
    said += "principal point is wrong, or pixel centers are half a pixel off"
    return found._replace(said=said)


def find_distortion(e):
    """All photos are bent alike."""
    where = e.distortion_errors > LENS_ERRORS and not is_asked(e)
    px, limit_px = e.photo_px * e.distortion_px, e.photo_px * BEND_PX
    return of_part(e, "distortion", base.beyond(px, limit_px, where=where))


def find_focal(e):
    """By matches alone: a model takes a wrong focal length for another shape."""
    if not is_asked(e):
        return None
    found = of_part(e, "focal")
    if not part_px(e, "focal"):
        return found
    ratio = f"{by_matches(e).focal_ratio:.4f}"
    advice = f"multiply the focal length by {ratio}, or {FOCAL.advice}"
    if e.judged:
        advice = f"multiply the focal length by {ratio}, and train again."
        advice = CORRECTED if corrects(e) else advice
    return found._replace(said=ratio, advice=advice)


def find_shutter(e):
    """By matches alone: from the first row to the last of the median photo."""
    return of_part(e, "shutter") if is_asked(e) else None


def cause(**texts):
    """The record of a part of the lens."""
    return base.Cause(unit="px", explains=EXPLAINS, spoils=SPOILS, **texts)


SHIFT = cause(
    name="lens_shift",
    label="principal point",
    find=find_shift,
    called="the principal point is {probably}off",
    sentence="{said}.",
    advice="check the pixel centers and principal point of the input cameras.",
    advice_external="check the pixel centers and principal point that your program "
    "had: a wrong origin of pixels misaligns by half a pixel.",
)
DISTORTION = cause(
    name="lens_distortion",
    label="lens distortion",
    find=find_distortion,
    called="the lens distortion is {probably}wrong",
    sentence="All photos are {probably}distorted alike, by {px} at the corners: the "
    "lens distortion is wrong.",
    advice="calibrate the lens again, or let COLMAP estimate it.",
    advice_external="calibrate the lens again, or undistort the photos first.",
)
FOCAL = cause(
    name="focal",
    label="focal length",
    find=find_focal,
    called="the focal length is {probably}off",
    sentence="The focal length is {probably}off: matches between photos fit {said} "
    "times the one in use.",
    advice="adjust the cameras before training: `poses: adjusted` in the config.",
)
SHUTTER = cause(
    name="rolling_shutter",
    label="rolling shutter",
    find=find_shutter,
    called="a rolling shutter {probably}skews the photos",
    sentence="A rolling shutter {probably}skews the photos: by {px} from the first row "
    "to the last of the median photo, with the camera's motion.",
    advice="move the camera slower, or take photos instead of a video. Nothing here "
    "corrects a rolling shutter.",
    advice_external="move the camera slower, or take photos instead of a video; some "
    "programs model a rolling shutter.",
)
CAUSE = [SHIFT, DISTORTION, FOCAL, SHUTTER]
