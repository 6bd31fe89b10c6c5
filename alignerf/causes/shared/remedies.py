"""What a run's remedies brought, and what follows from it."""

from typing import NamedTuple

from alignerf import testsets
from alignerf.causes.shared import misalignment
from alignerf.io import provenance


class Gain(NamedTuple):
    """A remedy's gain in this run, in dB with its interval, and its minutes."""

    name: str
    db: float
    low: float
    high: float
    minutes: float
    method: str = ""
    # Whether it has moved its cameras: on the way, or between rounds.
    in_loop: bool = False
    test_set: str = ""
    # Of a training that aligned itself: how many cameras it has moved at the most.
    cameras_moved: int | None = None
    # Whether it has warped its photos, by either.
    warped: bool = False
    # What held-out matches say of its cameras (`acceptance.Judgement.told`).
    matches: dict | None = None


def pays(e, gain):
    """Whether a remedy's gain is significant, on enough held-out photos.

    Thousands of matches that a correction has not seen come before a few photos: where
    they are twice as near it pays, where they are further off it does not. Scores on
    the photos as they are say nothing of moved cameras.
    """
    if gain.matches and gain.matches["halved"] and not gain.high < 0:
        return True
    if gain.matches and gain.matches["worse"]:
        return False
    moves = ["cameras"] * bool(gain.in_loop)
    fair = not testsets.is_unfair(gain.test_set, moves)
    return fair and e.test_views >= misalignment.FEW_TEST_VIEWS and gain.low > 0


def advise(e, *, only_paying=False):
    """Advice where this run has moved cameras, else nothing."""
    tried = [gain for gain in e.tried if gain.in_loop]
    if not tried:
        return ""
    best = max(tried, key=lambda gain: (pays(e, gain), gain.db))
    if best.cameras_moved == 0:
        # Nothing is gained by cameras that are those given.
        return f"leave the cameras as they are: {best.method} found none to move."
    if pays(e, best):
        return (
            "train on the corrected cameras, which "
            f"`{provenance.export_command()}` writes."
        )
    if only_paying or e.test_views < misalignment.FEW_TEST_VIEWS:
        return ""
    return (
        f"leave cameras and photos as they are: what {best.method} corrected brought "
        "no significant gain. Train longer."
    )


def warped_in_vain(e):
    """Advice where this run warped photos without a gain, by enough views; else "".

    A remedy that also moves cameras is for `advise` to judge.
    """
    lows = [gain.low for gain in e.tried if gain.warped and not gain.in_loop]
    if not lows or e.test_views < misalignment.FEW_TEST_VIEWS or max(lows) > 0:
        return ""
    return "leave the photos as they are: warping them brought no significant gain."
