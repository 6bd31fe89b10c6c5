"""Poses are off: a moved camera explains the flow, or shared points disagree."""

import math

from alignerf.causes import base, coverage, lens, remedies, shift

# Of the flow's parts, one that is at least so long is named.
PART_PX = 0.2
# Of points that photos share: right cameras see them 0.2 px from where they are found,
# given poses of real captures up to 0.6 px, cameras that are off by 2 px 1.3 px.
REPROJECTION_PX = 0.8
# Right cameras leave no more of the matches' error, in px of the photo.
RIGHT_PX = 0.6
# In dB on courtyard, where poses are off by 1.5 px and objects move, over plain
# training of the same seconds, those of one and of two (docs/measured/in_loop.csv).
AUTO_DB, AUTO_TWICE_DB = 1.2, 2.1
ALIGN = (
    "correct the cameras in the loop (a method with auto: true): one training corrects "
    "them by optical flow, then optimizes them. On the demo's scene it brought "
    f"{AUTO_DB} dB in the time of one training, {AUTO_TWICE_DB} dB in that of two."
)
# Where another program was trained: `align` is a method of ours.
OF_OTHERS = (
    "correct its cameras in a round (rounds: 1 and changes: cameras of this method), "
    "or take those of a training with auto: true."
)
# Where the poses came with the photos, COLMAP finds others: on a phone's capture they
# were 0.9 to 3.5 dB better than the phone's own (docs/measured/in_loop_real.csv).
ANEW = (
    "let COLMAP estimate the poses again, from the photos alone, copied into a folder "
    "of their own."
)
# Where matches between photos say how cameras have to move.
ADJUSTED = (
    "adjust the cameras before training: `poses: adjusted` in the config, or a method "
    "with adjust: true. Half a minute of bundle adjustment, without a training."
)


def source(e):
    """What shows that poses are off: `crops`, `flow`, `matches`, `points`; or None.

    The first that says so. From too few photos a wrong pose is learnt as geometry, so
    that training views fit: then the points that photos share tell.
    """
    if shift.by_crops(e) and e.crops.camera_px > e.crops.remainder_px:
        return "crops"
    # Matches that fit, and find nothing to correct, are the witness that denies it.
    m = e.matches
    denied = m and not m.accepted and m.before_px <= RIGHT_PX
    told = shift.misaligned(e) and not shift.too_short(e) and not denied
    if told and e.camera_px > PART_PX:
        return "flow"
    if shift.poses_off(e):
        return "matches"
    if coverage.sparse(e) and e.reprojection_px > REPROJECTION_PX:
        return "points"
    return None


def is_shared(e):
    """Whether the shift that all renders of another program share is all of it.

    A shift of the picture looks like a turn of the camera, the same in all views. Our
    own trainings absorb nearly all of such a shift.
    """
    if not (e.judged and lens.SHIFT.decide(e)):
        return False
    return e.camera_px**2 - e.shift_px**2 < PART_PX**2


def decide(e):
    """(size in px of the training, whether it is sure); None where poses are right."""
    shown = source(e)
    if shown == "flow" and is_shared(e):
        shown = "matches" if shift.poses_off(e) else None
    if shown == "crops":
        sure = e.crops.low_px > shift.CROP_PX
        return e.crops.camera_px / e.photo_px, sure
    if shown == "flow":
        sure = e.camera_px > 2 * PART_PX or shift.poses_off(e)
        return e.camera_px, sure
    if shown == "matches":
        return e.matches.pose_error_px / e.photo_px, False
    if shown == "points":
        return e.reprojection_px, e.reprojection_px > 2 * REPROJECTION_PX
    return None


def size_px(e, of):
    """How far poses are off by a source, in px of the photo."""
    if of == "crops":
        return e.crops.camera_px
    if of == "matches":
        return e.matches.pose_error_px
    return e.photo_px * (e.reprojection_px if of == "points" else e.camera_px)


def shown(e):
    """(what the gauge shows, its limit), in px of the photo."""
    of = "crops" if shift.known_crops(e) else source(e)
    limits = {"crops": shift.CROP_PX, "points": e.photo_px * REPROJECTION_PX}
    return size_px(e, of), limits.get(of, e.photo_px * PART_PX)


def is_detectable(e):
    """Whether matches say something of the poses, or a shift would be seen."""
    seen = shift.is_sharp(e) and (shift.tells(e) or shift.misaligned(e))
    return bool(e.matches) or seen


def sentence(e, probably):
    """What shows it, and how much."""
    of = source(e)
    px, lead = base.length(size_px(e, of)), f"Poses are {probably}off:"
    if of == "matches":
        return f"{lead} bundle adjustment of matches between photos moves them by {px}."
    if of == "points":
        where = "points that several photos show lie"
        return f"{lead} {where} {px} from where the cameras expect them."
    where = "in the crops " * (of == "crops")
    return f"{lead} {where}a moved camera explains {px} of the misalignment."


def text(e):
    """Advice where nothing was tried; only other programs do not say what they saw."""
    return OF_OTHERS if math.isnan(e.epochs) else ALIGN


def anew(e):
    """Advice for poses that came with the photos, and the command where it is known."""
    if e.by_colmap is None:
        return ANEW
    return (
        f"let COLMAP estimate the poses again, from the photos alone: `{e.by_colmap}`."
    )


def advise(e, gains):
    """What to do, by what this run has tried."""
    own = remedies.advise(e, gains)
    if shift.poses_off(e) and not own:
        said = ADJUSTED
    elif not e.poses_given:
        said = own or text(e)
    elif any(remedies.pays(e, gain) for gain in gains if gain.in_loop):
        said = f"{anew(e)} Until then {own}"
    else:
        # What was tried in vain is not offered beside it.
        said = anew(e) if own else f"{anew(e)} Or {text(e)}"
    more = " And take more photos between those you have."
    return said + more * (source(e) == "points")


def stands(e):
    """Whether crops or matches tell of poses, whatever flows come from."""
    told = shift.poses_off(e) or source(e) == "crops"
    return told and not lens.is_alone(e)


CAUSE = base.Cause(
    name="camera",
    page="howto/fix.md#poses-are-off",
    order=(1, 5.2, 6),
    label="camera poses",
    unit="px",
    value=lambda e: shown(e)[0],
    limit=lambda e: shown(e)[1],
    decide=decide,
    detectable=is_detectable,
    seen_by_points=True,
    explains=("sparse", "motion", "exposure", "floaters", "tone"),
    # Where photos are too few, points tell of poses beside that.
    explains_now=lambda e: source(e) != "points",
    spoils="wrong poses distort the model",
    stands=stands,
    called="poses are {probably}off",
    sentence=sentence,
    advice=advise,
    advice_external="train again with the corrected cameras: `{export}` writes them.",
)
