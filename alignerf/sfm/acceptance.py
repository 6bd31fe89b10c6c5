"""Whether a correction of cameras is taken: by matches that it has not seen.

Five held-out photos cannot tell a pose error of 1.4 px from one of 0.5; thousands of
held-out matches can. Chance lies in which tracks are held out, not in which photos were
taken: a correction of two photos of sixteen counts.
"""

from typing import NamedTuple

import numpy as np

from alignerf.sfm import calibration
from alignerf.sfm.calibration import Cameras
from alignerf.sfm.matches import HELD_OUT, Matches

# By how much the error has to fall, in px of the photo.
MIN_GAIN_PX = 0.05
# A correction that leaves less than this of the error is taken whatever photos say.
FRACTION_LEFT = 0.5
# Of the error, by which another parameter of the lens has to lessen it.
MIN_FRACTION = 0.05
# Views with fewer held-out matches say nothing by themselves.
MIN_MATCHES = 5
# In px of the photo, the most that a match counts as off.
FAR_PX = 20.0
# Of a normal distribution, within which 95 % lie.
ERRORS_95 = 1.96


class Judgement(NamedTuple):
    """Median epipolar error of held-out matches, in px of the photo, over views.

    gain_px: mean over views of what the error of their matches fell by, with its 95 %
    interval over tracks; in_halves: by each half of the tracks.
    """

    before_px: float
    after_px: float
    gain_px: float
    low_px: float
    high_px: float
    views: int
    matches: int
    in_halves: tuple = (np.nan, np.nan)

    @property
    def accepted(self):
        """Whether the error falls by enough, and by more than chance."""
        return self.gain_px >= MIN_GAIN_PX and self.low_px > 0

    @property
    def finer(self):
        """Whether one more parameter of the lens shows, however little it matters."""
        shows = self.low_px > 0 and min(self.in_halves) > 0
        return shows and self.gain_px >= MIN_FRACTION * self.before_px

    @property
    def halved(self):
        """Whether it is accepted, and the error more than halved."""
        return self.accepted and self.after_px < FRACTION_LEFT * self.before_px

    @property
    def worse(self):
        """Whether the error grows by as much, and by more than chance."""
        return self.gain_px <= -MIN_GAIN_PX and self.high_px < 0

    def told(self):
        """For a report in JSON; null for what is not known."""
        numbers = self._asdict()
        del numbers["in_halves"]
        numbers = rounded(numbers, 4)
        flags = ("accepted", "halved", "worse")
        return numbers | {flag: bool(getattr(self, flag)) for flag in flags}


def rounded(numbers, digits):
    """Numbers for JSON; null for what is not known."""
    return {
        key: round(value, digits) if np.isfinite(value) else None
        for key, value in numbers.items()
    }


def judge(matches: Matches, before: Cameras, after: Cameras, photo_px=1.0, moved=None):
    """The `Judgement` of the cameras `after` over those `before`.

    Both are in px of the matches; photo_px: px of the photo in one of these. moved: the
    matches as those `after` see them, where another shutter moves them.
    """
    n, (views, _) = len(matches.names), matches.places(held_out=True)
    errors = [
        photo_px * calibration.errors_of_matches(*one, held_out=True)[1]
        for one in ((matches, before), (moved or matches, after))
    ]
    counts = np.bincount(views.ravel(), minlength=n)
    # A match between views of which one says nothing is none.
    known = (counts >= MIN_MATCHES)[views].all(axis=1) & np.isfinite(errors).all(axis=0)
    if not known.any():
        return Judgement(*[np.nan] * 5, views=0, matches=len(views))
    medians = [calibration.by_view(views[known], one[known], n) for one in errors]
    seen = np.isfinite(medians[0])
    gains = np.subtract(*(np.minimum(one[known], FAR_PX) for one in errors))
    draws = tracks_of(matches)[known]
    gain_px, error_px = mean_of_views(views[known], gains, draws)
    halves = draws < np.median(draws), draws >= np.median(draws)
    return Judgement(
        *(float(np.median(one[seen])) for one in medians),
        *(gain_px, gain_px - ERRORS_95 * error_px, gain_px + ERRORS_95 * error_px),
        views=int(seen.sum()),
        matches=len(views),
        in_halves=tuple(
            mean_of_views(views[known][one], gains[one], draws[one])[0]
            for one in halves
        ),
    )


def tracks_of(matches: Matches):
    """[m] number of each held-out match's track, which is drawn between 0 and 1."""
    pairs = zip(matches.pairs, matches.indices, strict=True)
    draws = [matches.draws[i][index[:, 0]] for (i, _), index in pairs]
    draws = np.concatenate([np.zeros(0), *draws])
    return draws[draws < HELD_OUT]


def mean_of_views(views, values, tracks):
    """(mean over views of the mean [m] of their matches, its error over tracks)."""
    if not len(values):
        return np.nan, np.inf
    counts = np.bincount(views.ravel())
    # Each view has one vote, and each of its matches an equal part of it.
    weights = (1 / counts[views]).sum(axis=1) / (counts > 0).sum()
    mean = float((weights * values).sum())
    _, track = np.unique(tracks, return_inverse=True)
    off = np.bincount(track, weights * (values - mean))
    if (count := len(off)) < 2:
        return mean, np.inf
    return mean, float(np.sqrt((off**2).sum() * count / (count - 1)))
