"""What a cause is, and the numbers that causes are decided by.

Lengths are pixels of the training size; those of crops, and those that are told, are
pixels of the photo: the others change with `downscale`. NaN is unknown.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from alignerf.metrics import pairs as of_pairs
from alignerf.sfm.lens import Lens

# Photos that a sentence names.
MAX_NAMED = 5
NO_PHOTOS: dict = {}


class Matches(NamedTuple):
    """What bundle adjustment says of the cameras; lengths in px of the photo.

    accepted: whether held-out matches gain by it, their error going from before_px to
    after_px; applied: whether the scene has the adjusted cameras. pose_error_px,
    worst_px: how far the input cameras were from these, in the median and worst view.
    lens: what another lens alone explains, the input poses held; left: the same of the
    adjusted ones. named: the faults of the input cameras in words, the lens first.
    kept: parts of the lens that the adjustment had free, and left as they came.
    """

    accepted: bool
    applied: bool
    before_px: float
    after_px: float
    pose_error_px: float
    worst_px: float
    lens: Lens | None = None
    left: Lens | None = None
    named: tuple[str, ...] = ()
    kept: tuple[str, ...] = ()


class Crops(NamedTuple):
    """Crops with the cameras as given; lengths are in px of the photo.

    flow_px, camera_px, remainder_px: medians over the training photos of their crops'
    medians; low_px, high_px: the 95 % interval of the first. corrected_px: the same of
    crops with the cameras that a method has corrected; NaN where there are none.
    """

    places: int
    px: int
    photos: int
    test_photos: int
    flow_px: float
    low_px: float
    high_px: float
    flow_test_px: float
    camera_px: float
    remainder_px: float
    epochs: float
    corrected_px: float = math.nan


class ExternalRenders(NamedTuple):
    """How a scene of another program's renders was put together.

    depth: `given`, of `points`, or `far`; cameras: what told them, `none` where nothing
    did; layout: how the renders lay; before: of a judgement before this one, its name,
    shifts of training and held-out views in px of the photo, and scores; None without
    one. trained_px: the longest side of the photos trained on, where the trainer says
    it. scores: of held-out views, see `verdict.evidence`; None without any.
    """

    depth: str
    cameras: str
    layout: str
    before: tuple | None = None
    trained_px: float | None = None
    scores: dict | None = None


class Evidence(NamedTuple):
    """The numbers that the causes are decided by."""

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
    moved_fraction: float
    # Of renders as bright as their photos: exposure is a cause of its own.
    psnr_train_db: float
    psnr_test_db: float
    # What an estimator invents where nothing is.
    overfit_px: float
    epochs: float
    detail_median: float
    blurred_fraction: float
    # By what each photo is brighter than its render, beside what all are.
    exposure_ev: float
    # The same by points that photos share.
    shared_ev: float
    shift_px: float
    shift_errors: float
    distortion_px: float
    distortion_errors: float
    photo_width_px: float = math.nan
    # Detail of renders over photos, the finest octave first (`metrics.spectrum`).
    octaves: tuple = (math.nan,) * 5
    # Of all renders alike (`metrics.tone`).
    tone_gain_ev: float = math.nan
    tone_gamma: float = math.nan
    tone_white_ev: float = math.nan
    exchanged: float = math.nan
    # From how far aside photos see what held-out ones see (`cameras.spacing`).
    apart_deg: float = math.nan
    # Photos that lie there twice; views that a floater hides a part of.
    copies: int = 0
    hidden_views: float = 0
    # Of what photos show, what others of the same place do not.
    transient_fraction: float = math.nan
    # Whether the poses came with the photos, and the error that was put into them.
    poses_given: bool = False
    perturb_px: float = 0.0
    perturb_by: str = "rotation"
    # At the photos' own size; None without.
    crops: Crops | None = None
    # Of renders of another program; None of ours.
    judged: ExternalRenders | None = None
    # None where matches were not asked.
    matches: Matches | None = None
    # Which pairs of photo and render are none.
    pairs: of_pairs.Checked = of_pairs.Checked(0, {})
    # The command that lets COLMAP find the poses, where photos lie without cameras.
    by_colmap: str | None = None
    # What this run has tried, `remedies.Gain`s.
    tried: tuple = ()
    # {name of a cause: names of the photos that it is about}.
    photos: dict = NO_PHOTOS


@dataclass(frozen=True, kw_only=True)
class Cause:
    """Something that can be wrong with a scene: how it is found, told and fixed.

    name: in verdict.json. label, unit: of its gauge.
    find: of an Evidence, its `Finding`, also where all is well; None where it is not
    looked for.
    explains: names of causes whose evidence this one spoils where it is found: they are
    not told then, because `spoils`.
    called: a phrase for the headline; {probably} is empty where the cause is sure.
    sentence: with its number: {probably}, {value}, {px} is the value as a length,
    {said} is the Finding's, {photos} the first few in brackets, or nothing.
    advice: what to do, never nothing. advice_external: in its place where another
    program was trained; {export} writes corrected photos and cameras.
    page: below docs/, what to do about it.
    """

    name: str
    label: str
    unit: str
    find: Callable
    called: str
    sentence: str
    advice: str
    advice_external: str = ""
    explains: tuple = ()
    spoils: str = ""
    page: str = "howto/verdict.md#what-to-do"


class Finding(NamedTuple):
    """What an Evidence says of a cause.

    value, limit: in the unit, or else the cause's; NaN where unknown. sure: whether the
    cause is beyond doubt; None where it is not found. more_is_better: right values are
    above the limit.
    said: for its sentence. measured: in place of value and unit. advice: in place of
    the cause's.
    detectable: whether the run tells the cause. stands: whether it is told by what no
    other cause spoils. explains: whether it spoils what the cause `explains`.
    photos: names of those that it is about, where it is of some.
    cause, why its evidence is spoilt, and (low, middle, high) dB that its removal is
    estimated to bring, None where unknown: as `causes.examine` finds them.
    """

    value: float
    limit: float
    sure: bool | None = None
    more_is_better: bool = False
    said: str = ""
    measured: str = ""
    unit: str = ""
    advice: str = ""
    detectable: bool = True
    stands: bool = False
    explains: bool = True
    photos: tuple = ()
    cause: Cause | None = None
    spoilt: str = ""
    at_stake: tuple | None = None

    @property
    def size(self):
        """How many times its limit it is; where none is allowed, its value."""
        part, whole = self.value, self.limit
        if not whole:
            return part
        if self.more_is_better:
            part, whole = whole, part
        # What is unknown stays so.
        return part / max(whole, 1e-9)

    @property
    def called(self):
        """The phrase for the headline."""
        return self.cause.called.format(probably=probably(self.sure))

    @property
    def sentence(self):
        """What is said of it, with its number."""
        return self.cause.sentence.format(
            probably=probably(self.sure),
            value=self.value,
            px=length(self.value),
            said=self.said,
            photos=f" ({some(self.photos)})" * bool(self.photos),
        )

    def told(self, *, external):
        """Its advice; external: where another program was trained."""
        cause = self.cause
        return self.advice or (external and cause.advice_external) or cause.advice


def beyond(value, limit, *, more_is_better=False, where=True, **more):
    """The `Finding` of a value: found beyond its limit, sure beyond twice the limit.

    where: what has to hold besides.
    """
    size, least = (limit, value) if more_is_better else (value, limit)
    sure = size > 2 * least if size > least and where else None
    return Finding(value, limit, sure, more_is_better, **more)


def some(names):
    """The first few names, and how many there are more."""
    more = len(names) - MAX_NAMED
    return ", ".join(names[:MAX_NAMED]) + f" and {more} more" * (more > 0)


def probably(sure):
    """A word for texts."""
    return "" if sure else "probably "


def length(photo_px):
    """A length in px of the photo, with two digits that count."""
    if not math.isfinite(photo_px):
        return "unknown"
    return f"{photo_px:.1f} px" if photo_px >= 0.95 else f"{photo_px:.2f} px"


def amount(value, unit):
    """A value in its unit: a length as `length` tells it, else two digits."""
    return length(value) if unit == "px" else f"{number(value)} {unit}"


def number(value):
    """Two digits that count; a whole number as it is."""
    if not math.isfinite(value):
        return "unknown"
    return (
        f"{value:.0f}" if abs(value) >= 9.5 or value == int(value) else f"{value:.2g}"
    )
