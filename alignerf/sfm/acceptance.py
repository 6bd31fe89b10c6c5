"""Whether a correction of cameras is taken: by matches that it has not seen.

Five held-out photos cannot tell a pose error of 1.4 px from one of 0.5; thousands of
held-out matches can.
"""

from typing import NamedTuple

import numpy as np

from alignerf.sfm import calibration
from alignerf.sfm.calibration import Cameras
from alignerf.sfm.matches import Matches
from alignerf.tables import intervals

# By how much the error has to fall, in px of the photo.
MIN_GAIN_PX = 0.05
# A correction that leaves less than this of the error is taken whatever photos say.
FRACTION_LEFT = 0.5
# Of the error, by which another parameter of the lens has to lessen it.
MIN_FRACTION = 0.05
# Views with fewer held-out matches say nothing by themselves.
MIN_MATCHES = 5


class Judgement(NamedTuple):
    """Median epipolar error of held-out matches, in px of the photo, over views.

    gain_px: mean over views of what the error fell by, with its 95 % interval.
    """

    before_px: float
    after_px: float
    gain_px: float
    low_px: float
    high_px: float
    views: int
    matches: int

    @property
    def accepted(self):
        """Whether the error falls by enough, and by more than chance."""
        return self.gain_px >= MIN_GAIN_PX and self.low_px > 0

    @property
    def finer(self):
        """Whether one more parameter of the lens shows, however little it matters."""
        return self.gain_px >= MIN_FRACTION * self.before_px and self.low_px > 0

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
        numbers = rounded(self._asdict(), 4)
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
        photo_px * calibration.errors_of_views(*one, held_out=True)
        for one in ((matches, before), (moved or matches, after))
    ]
    known = np.isfinite(errors[0]) & np.isfinite(errors[1])
    known &= np.bincount(views.ravel(), minlength=n) >= MIN_MATCHES
    before_px, after_px = (one[known] for one in errors)
    if not known.any():
        return Judgement(*[np.nan] * 5, views=0, matches=len(views))
    gains = before_px - after_px
    return Judgement(
        float(np.median(before_px)),
        float(np.median(after_px)),
        float(gains.mean()),
        *intervals.mean_interval(gains),
        views=int(known.sum()),
        matches=len(views),
    )
