"""What is wrong, decided from numbers: pure, every threshold named and measured.

All lengths are pixels of the training size; those of windows are pixels of the photo.
The thresholds were chosen on variants of courtyard with one fault each, seed 1,
MOVED_SHARE and LENS_ERRORS on seeds 0 to 4. They were tested on other seeds, on pairs
of faults and on real captures: docs/evidence/verdict.md.
"""

import math
from typing import NamedTuple

from alignerf.metrics import pairs as of_pairs
from alignerf.verdict import shift
from alignerf.verdict import windows as of_windows

# Of the flow's parts, one that is at least so long is named.
PART_PX = 0.2
# Pixels that do not move with their camera: by so much at least, and by so much of what
# it moves, since a model that averages wrong poses is bent; and their share. That is up
# to 0.044 where nothing moves and poses are off, 0.061 and more where objects move.
MOVED_PX, MOVED_OF_CAMERA, MOVED_SHARE, MOVED_SURELY = 0.5, 0.7, 0.05, 0.08
# Training views fit their renders, test views do not: geometry that photos do not fix.
# A gap in PSNR says so alone, a smaller one beside flows of this ratio.
GAP_DB, SMALL_GAP_DB, TEST_OVER_TRAIN = 4.0, 2.5, 2.5
# Of points that photos share: right cameras see them 0.2 px from where they are found,
# given poses of real captures up to 0.6 px, cameras that are off by 2 px 1.3 px.
REPROJECTION_PX = 0.8
# Share of the photos that COLMAP has placed.
REGISTERED = 0.9
# Fine detail of a photo over its render's.
BLURRED_DETAIL, BLURRED_VIEWS = 0.6, 0.05
# Standard deviation over views, of photos over their renders; and of photos over one
# another. A slow change is learnt as a colour that depends on the direction, so that
# no render shows it, and does less harm: a phone that exposes as it goes comes to 0.13.
EXPOSURE_EV, SHARED_EV = 0.06, 0.16
# Common to all views' flows, and beyond so many standard errors. A model absorbs nine
# tenths of a shift.
SHIFT_PX, BEND_PX, LENS_ERRORS = 0.045, 0.08, 3.0


class Matches(NamedTuple):
    """What bundle adjustment says of the cameras; lengths in px of the photo.

    accepted: whether held-out matches gain by it, their error going from before_px to
    after_px; applied: whether the scene has the adjusted cameras. pose_error_px,
    worst_px: how far the input cameras were from these, in the median and worst view.
    """

    accepted: bool
    applied: bool
    before_px: float
    after_px: float
    pose_error_px: float
    worst_px: float


class Evidence(NamedTuple):
    """The numbers that the causes are decided by; NaN is unknown."""

    train_views: int
    test_views: int
    registered: int
    total: int
    # Pixels of the original photo in one of the training's.
    photo_px: float
    reprojection_px: float
    flow_train_px: float
    flow_test_px: float
    camera_px: float
    remainder_px: float
    moved_share: float
    # Of renders as bright as their photos: exposure is a cause of its own.
    psnr_train_db: float
    psnr_test_db: float
    # What an estimator invents where nothing is.
    overfit_px: float
    passes: float
    detail_median: float
    blurred_share: float
    exposure_ev: float
    # The same by points that photos share.
    shared_ev: float
    shift_px: float
    shift_errors: float
    distortion_px: float
    distortion_errors: float
    photo_width_px: float = math.nan
    # Whether the poses came with the photos, and the error that was put into them.
    poses_given: bool = False
    perturb_px: float = 0.0
    # At the photos' own size; None without.
    windows: of_windows.Windows | None = None
    # How renders of another program were put together (`judged.Judged`), or None.
    judged: tuple | None = None
    # What matches say of the cameras; None where they were not asked.
    matches: Matches | None = None
    # Which pairs of photo and render are none.
    pairs: of_pairs.Checked = of_pairs.Checked(0, {})


class Finding(NamedTuple):
    """A cause, how large it is in its own unit, and whether that is beyond doubt."""

    cause: str
    size: float
    sure: bool


def find(evidence: Evidence) -> list[Finding]:
    """The causes that apply, the gravest first; empty where nothing is wrong."""
    if evidence.pairs.stops:
        return [pairs(evidence)]
    tests = (pairs, few_views, unregistered, sparse, undertrained, lens_shift)
    tests = (*tests, lens_distortion, blurred, exposure, camera, motion)
    findings = [finding for test in tests if (finding := test(evidence))]
    if shift.too_short(evidence):
        # Renders that are blurred by too little training move the flow, too.
        told = shift.by_windows(evidence) or by_matches(evidence)
        plain = (*PLAIN, *["camera"] * told)
        findings = [finding for finding in findings if finding.cause in plain]
    return findings


# Causes that need no sharp render.
PLAIN = ("pairs", "few_views", "unregistered", "undertrained", "blurred", "exposure")


def pairs(e: Evidence):
    """Renders of another program that are not those of their photos."""
    share = len(e.pairs.faults) / max(e.pairs.count, 1)
    return Finding("pairs", share, True) if share else None


def few_views(e: Evidence):
    """Too few photos to learn or to judge from."""
    few_test = e.test_views < shift.FEW_TEST_VIEWS and not e.judged
    if shift.few_train(e) or few_test:
        return Finding("few_views", e.train_views + e.test_views, True)
    return None


def unregistered(e: Evidence):
    """Photos that are in no model, or in another one."""
    share = e.registered / max(e.total, 1)
    if share < REGISTERED:
        return Finding("unregistered", share, True)
    return None


def sparse(e: Evidence):
    """Training views fit and test views do not: too few, or too far apart."""
    ratio = e.flow_test_px / max(e.flow_train_px, 0.05)
    gap_db = e.psnr_train_db - e.psnr_test_db
    by_flow = ratio > TEST_OVER_TRAIN and gap_db > SMALL_GAP_DB
    if not (gap_db > GAP_DB or by_flow):
        return None
    return Finding("sparse", gap_db, ratio > TEST_OVER_TRAIN and gap_db > GAP_DB)


def lens_shift(e: Evidence):
    """All photos are shifted alike: a principal point, or half a pixel."""
    if e.shift_px > SHIFT_PX and e.shift_errors > LENS_ERRORS:
        return Finding("lens_shift", e.shift_px, e.shift_px > 2 * SHIFT_PX)
    return None


def lens_distortion(e: Evidence):
    """All photos are bent alike."""
    if e.distortion_px > BEND_PX and e.distortion_errors > LENS_ERRORS:
        return Finding(
            "lens_distortion", e.distortion_px, e.distortion_px > 2 * BEND_PX
        )
    return None


def blurred(e: Evidence):
    """Some photos have less detail than the render of their view."""
    if e.blurred_share > BLURRED_VIEWS:
        return Finding("blurred", e.blurred_share, e.blurred_share > 2 * BLURRED_VIEWS)
    return None


def exposure(e: Evidence):
    """Brightness changes from photo to photo, or slowly over all of them."""
    size, limit = exposure_of(e)
    return Finding("exposure", size, size > 2 * limit) if size > limit else None


def exposure_of(e: Evidence):
    """(how much exposure changes in stops, its limit), by what shows it best.

    Depth of a training that was too short does not say which points photos share.
    """
    told = [(e.exposure_ev, EXPOSURE_EV)]
    if math.isfinite(e.shared_ev) and not shift.too_short(e):
        told.append((e.shared_ev, SHARED_EV))
    return max(told, key=lambda one: one[0] / one[1])


def undertrained(e: Evidence):
    """Pixels have hardly been seen."""
    if e.passes < shift.FEW_PASSES:
        return Finding("undertrained", e.passes, e.passes < shift.FEW_PASSES / 2)
    return None


def camera(e: Evidence):
    """Poses are off: a moved camera explains the flow, or shared points disagree.

    Its size is in px of the training.
    """
    source = source_of_camera(e)
    if source == "flow" and is_shared(e):
        source = "matches" if by_matches(e) else None
    if source == "windows":
        size = e.windows.camera_px / e.photo_px
        sure = e.windows.low_px > shift.WINDOW_PX
        return Finding("camera", size, sure and not is_denied(e))
    if source == "flow":
        sure = e.camera_px > 2 * PART_PX or by_matches(e)
        return Finding("camera", e.camera_px, sure and not is_denied(e))
    if source == "matches":
        return Finding("camera", e.matches.pose_error_px / e.photo_px, False)
    if source == "points":
        error_px = e.reprojection_px
        return Finding("camera", error_px, error_px > 2 * REPROJECTION_PX)
    return None


def is_shared(e: Evidence):
    """Whether the shift that all renders of another program share is all of it.

    A shift of the picture looks like a turn of the camera, the same in all views. Our
    own trainings absorb nearly all of such a shift.
    """
    if not (e.judged and lens_shift(e)):
        return False
    return e.camera_px**2 - e.shift_px**2 < PART_PX**2


def by_matches(e: Evidence):
    """Whether matches say that the cameras in use are off."""
    return bool(e.matches and e.matches.accepted and not e.matches.applied)


def is_denied(e: Evidence):
    """Whether matches find nothing to correct in cameras of renders that are judged.

    Two witnesses make a wrong pose sure.
    """
    return bool(e.judged and e.matches and not e.matches.accepted)


def source_of_camera(e: Evidence):
    """What shows that poses are off; None: nothing does.

    `windows`, `flow`, `matches`, `points`, the first that says so.

    From too few photos a wrong pose is learnt as geometry, so that training views fit:
    then the points that photos share tell.
    """
    if shift.by_windows(e) and e.windows.camera_px > e.windows.remainder_px:
        return "windows"
    if shift.misaligned(e) and not shift.too_short(e) and e.camera_px > PART_PX:
        return "flow"
    if by_matches(e):
        return "matches"
    if sparse(e) is not None and e.reprojection_px > REPROJECTION_PX:
        return "points"
    return None


def motion(e: Evidence):
    """The scene moved between photos."""
    if e.moved_share > MOVED_SHARE:
        return Finding("motion", e.moved_share, e.moved_share > MOVED_SURELY)
    return None
