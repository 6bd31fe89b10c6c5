"""Poses are off: a moved camera explains the flow, or shared points disagree."""

import math

from alignerf.causes import base, coverage, lens
from alignerf.causes.shared import misalignment, remedies

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
ANEW = "let COLMAP estimate the poses again, from the photos alone"
# Where matches between photos say how cameras have to move.
ADJUSTED = (
    "adjust the cameras before training: `poses: adjusted` in the config, or a method "
    "with adjust: true. Half a minute of bundle adjustment, without a training."
)


def shown(e):
    """The `base.Finding` of the first that shows that poses are off; None of none.

    From too few photos a wrong pose is learnt as geometry, so that training views fit:
    then the points that photos share tell.
    """
    explained = "a moved camera explains {} of the misalignment"
    limit_px, poses_off = e.photo_px * PART_PX, misalignment.poses_off(e)
    if misalignment.by_crops(e) and e.crops.camera_px > e.crops.remainder_px:
        px, sure = e.crops.camera_px, e.crops.low_px > misalignment.CROP_PX
        said = f"in the crops {explained.format(base.length(px))}"
        return base.Finding(px, misalignment.CROP_PX, sure, said=said, stands=True)
    told = misalignment.misaligned(e) and not misalignment.too_short(e)
    told = told and not denied(e)
    if told and e.camera_px > PART_PX and not is_shared(e):
        px, sure = e.photo_px * e.camera_px, e.camera_px > 2 * PART_PX or poses_off
        said = explained.format(base.length(px))
        return base.Finding(px, limit_px, sure, said=said)
    if poses_off:
        said = "bundle adjustment of matches between photos moves them by "
        said += base.length(e.matches.pose_error_px)
        return base.Finding(e.matches.pose_error_px, limit_px, False, said=said)
    if coverage.is_sparse(e) and e.reprojection_px > REPROJECTION_PX:
        px = e.photo_px * e.reprojection_px
        said = f"points that several photos show lie {base.length(px)} from where the "
        found = base.beyond(px, e.photo_px * REPROJECTION_PX, explains=False)
        return found._replace(said=f"{said}cameras expect them")
    return None


def denied(e):
    """Whether matches deny that cameras are off; None where they are no witness.

    Those that fit, and find nothing to correct, do; so do those that no cameras fit.
    """
    m = e.matches
    fits = m and not misalignment.corrected(m) and m.before_px <= RIGHT_PX
    return m and bool(fits or misalignment.is_scattered(e))


def is_shared(e):
    """Whether the shift that all renders of another program share is all of it.

    A shift of the picture looks like a turn of the camera, the same in all views. Our
    own trainings absorb nearly all of such a shift.
    """
    if not e.judged or lens.find_shift(e).sure is None:
        return False
    return e.camera_px**2 - e.shift_px**2 < PART_PX**2


def find(e):
    """How far poses are off in px of the photo, by what shows it; else by flow."""
    flow = base.Finding(e.photo_px * e.camera_px, e.photo_px * PART_PX)
    found = shown(e) or flow
    if misalignment.known_crops(e):
        found = found._replace(value=e.crops.camera_px, limit=misalignment.CROP_PX)
    # Whether a shift would be seen.
    seen = misalignment.tells(e) or misalignment.misaligned(e)
    # Crops or matches tell of poses, whatever flows come from.
    stands = found.stands or misalignment.poses_off(e)
    return found._replace(
        advice="" if e.judged else advise(e, by_points=not found.explains),
        detectable=bool(e.matches) or (misalignment.is_sharp(e) and seen),
        stands=stands and not lens.is_alone(e),
    )


def align(e):
    """Advice where nothing was tried; only other programs do not say what they saw."""
    return OF_OTHERS if math.isnan(e.epochs) else ALIGN


def advise(e, *, by_points=False):
    """What to do, by what this run has tried. by_points: points show it."""
    own = remedies.advise(e)
    by = f": `{e.by_colmap}`" if e.by_colmap else ", copied into a folder of their own"
    anew = f"{ANEW}{by}."
    if misalignment.poses_off(e) and not own:
        said = ADJUSTED
    elif not e.poses_given:
        said = own or align(e)
    elif any(remedies.pays(e, gain) for gain in e.tried if gain.in_loop):
        said = f"{anew} Until then {own}"
    else:
        # What was tried in vain is not offered beside it.
        said = anew if own else f"{anew} Or {align(e)}"
    return said + " And take more photos between those you have." * by_points


CAUSE = base.Cause(
    name="camera",
    label="camera poses",
    unit="px",
    find=find,
    explains=("sparse", "motion", "exposure", "floaters", "tone"),
    spoils="wrong poses distort the model",
    called="poses are {probably}off",
    sentence="Poses are {probably}off: {said}.",
    advice=ALIGN,
    advice_external="train again with the corrected cameras: `{export}` writes them.",
    page="howto/fix.md#poses-are-off",
)
