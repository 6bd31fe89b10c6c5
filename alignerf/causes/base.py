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


class Matches(NamedTuple):
    """What bundle adjustment says of the cameras; lengths in px of the photo.

    accepted: whether held-out matches gain by it, their error going from before_px to
    after_px; applied: whether the scene has the adjusted cameras. pose_error_px,
    worst_px: how far the input cameras were from these, in the median and worst view.
    lens: what another lens alone explains, the input poses held; left: the same of the
    adjusted ones. named: the faults of the input cameras in words, the lens first.
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
    did; layout: how the renders lay; before: of a judgement before this one, its name
    and shifts of training and held-out views in px of the photo; None without one.
    """

    depth: str
    cameras: str
    layout: str
    before: tuple | None = None


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
    # Photos that lie there twice; views that a floater hides a part of.
    copies: int = 0
    hidden_views: float = 0
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


@dataclass(frozen=True, kw_only=True)
class Cause:
    """Something that can be wrong with a scene: how it is found, told and fixed.

    name: in verdict.json. label, unit: of its gauge.
    value, limit: numbers of an Evidence, NaN where unknown; beyond its limit a cause is
    named, beyond twice the limit it is sure. more_is_better: below
    these. scale: times which both are in `unit`. decide: (size, whether it is sure) of
    an Evidence, or None: in place of value and limit, where these are not all.
    explains: names of causes whose evidence this one spoils where it is found, and
    `explains_now` says so of an Evidence: they are not told then, because `spoils`,
    unless they `stand` by other evidence.
    detectable: whether the run of an Evidence tells it. looked_for: whether it is shown
    at all. says: of an Evidence, what was measured, in place of the value.
    called: a phrase for the headline; {probably} is empty where the cause is sure.
    sentence: with its number: {e}, {probably}, {value}, {px} is the value as a length;
    or a function of Evidence and {probably}.
    advice: what to do; or a function of Evidence and gains (`remedies.Gain`), of
    nothing where this run has tried that in vain. advice_external: as advice, where
    another program was trained; {export} writes corrected photos and cameras.
    seen_by_points: what is only probable counts also where photos are too few.
    page: below docs/, what to do about it.
    order: its places, among gauges; among what is named, the gravest first; and among
    what to do, first what a longer training, or work at the desk, fixes.
    """

    name: str
    label: str
    unit: str
    value: Callable
    limit: Callable
    called: str
    sentence: str | Callable
    advice: str | Callable
    advice_external: str | Callable = ""
    more_is_better: bool = False
    scale: Callable = lambda e: 1
    decide: Callable | None = None
    explains: tuple = ()
    explains_now: Callable = lambda e: True
    spoils: str = ""
    stands: Callable = lambda e: False
    detectable: Callable = lambda e: True
    looked_for: Callable = lambda e: True
    says: Callable | None = None
    seen_by_points: bool = False
    order: tuple = (100, 100, 100)
    page: str = "howto/verdict.md#what-to-do"

    def find(self, e):
        """The `Finding` where an Evidence has this cause, else None."""
        found = self.decide(e) if self.decide else self.beyond(e)
        return found and Finding(self, *found)

    def beyond(self, e):
        """(size, whether it is sure) where the value is beyond its limit."""
        value, limit = self.value(e), self.limit(e)
        sign, times = (-1, 0.5) if self.more_is_better else (1, 2)
        sure = sign * value > sign * times * limit
        return (value, sure) if sign * value > sign * limit else None


class Finding(NamedTuple):
    """A cause, how large it is in its own unit, and whether that is beyond doubt."""

    cause: Cause
    size: float
    sure: bool

    @property
    def called(self):
        """The phrase for the headline."""
        return self.cause.called.format(probably=self.probably)

    @property
    def probably(self):
        return "" if self.sure else "probably "

    def sentence(self, e):
        """What is said of it, with its number."""
        one, text = self.cause, self.cause.sentence
        if callable(text):
            return text(e, self.probably)
        value = one.scale(e) * one.value(e)
        return text.format(e=e, probably=self.probably, value=value, px=length(value))


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
