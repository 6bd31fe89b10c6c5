"""The verdict in plain words: each sentence with its number.

Lengths are given in pixels of the training and of the original photo, since the first
change with `downscale`.
"""

import math
from typing import NamedTuple

import numpy as np
import pandas as pd

from alignerf.files import csv_files
from alignerf.tables import scores
from alignerf.verdict import advice, causes


def say(evidence, findings, gains, views):
    """Lines of the verdict, the answer first.

    gains: as of `gains_of`.
    """
    lines = [headline(evidence, findings)]
    lines += [SENTENCES[finding.cause](finding, evidence) for finding in findings]
    lines.append(alignment(evidence))
    lines += photos(views)
    lines += [gain_line(gain, evidence) for gain in gains]
    lines.append("To do: " + advice.advise(evidence, findings, gains))
    return lines


def both(px, evidence):
    """A length in px of the training, and of the photo."""
    if not math.isfinite(px):
        return "unknown"
    photo = f" ({px * evidence.photo_px:.2f} px of the photo)"
    return f"{px:.2f} px" + (photo if evidence.photo_px != 1 else "")


def sure(finding):
    return "" if finding.sure else "probably "


def headline(e, findings):
    """One line: aligned or not, and the gravest cause."""
    named = [finding.cause for finding in findings]
    if "sparse" in named:
        poses = " Poses are off, too." if "camera" in named else ""
        return f"Verdict: too few photos, or too far apart: aligning is no help.{poses}"
    if "few_views" in named:
        return "Verdict: too few photos to say much."
    what = [CALLED[name] for name in named if name in CALLED]
    if causes.unclear(e):
        return "Verdict: trained too short to tell how well photos are aligned."
    if causes.misaligned(e):
        return f"Verdict: misaligned{': ' + ', '.join(what) if what else ''}."
    return f"Verdict: aligned{', but ' + ', '.join(what) if what else ''}."


def state(e, findings):
    """The verdict in a word: `aligned`, `misaligned` or `unclear`."""
    named = {finding.cause for finding in findings}
    if named & {"sparse", "few_views"} or causes.unclear(e):
        return "unclear"
    return "misaligned" if causes.misaligned(e) else "aligned"


CALLED = {
    "camera": "poses are off",
    "motion": "the scene moved",
    "lens_shift": "the principal point is off",
    "lens_distortion": "the lens is bent otherwise",
    "blurred": "some photos are blurred",
    "exposure": "exposure changes",
    "unregistered": "photos are left out",
    "undertrained": "trained too short",
}


def alignment(e):
    """How far photos and renders are apart, and what stays unknown."""
    parts = []
    if math.isfinite(e.flow_train_px):
        parts.append(f"{both(e.flow_train_px, e)} on photos that were learnt from")
    parts.append(f"{both(e.flow_test_px, e)} on held-out ones")
    return (
        f"Photos and renders are apart by {', '.join(parts)}; under "
        f"{both(causes.ALIGNED_PX, e)} nothing can be told."
    )


def camera(finding, e):
    if not causes.by_flow(e):
        return (
            f"Poses are {sure(finding)}off: points that several photos show lie "
            f"{both(e.reprojection_px, e)} from where the cameras expect them."
        )
    return (
        f"Poses are {sure(finding)}off: a moved camera explains {both(e.camera_px, e)}"
        f" of it."
    )


def motion(finding, e):
    return (
        f"The scene {sure(finding)}moved between photos: {100 * e.moved_share:.0f} % "
        "of a photo does not move with its camera."
    )


def sparse(finding, e):
    return (
        f"Photos are {sure(finding)}too few or too far apart: those learnt from are "
        f"matched to {e.psnr_train_db:.1f} dB, held-out ones to {e.psnr_test_db:.1f}."
    )


def few_views(finding, e):
    return (
        f"{e.train_views} photos to learn from and {e.test_views} to judge by are few: "
        f"{causes.FEW_TRAIN_VIEWS} and {causes.FEW_TEST_VIEWS} are the least."
    )


def unregistered(finding, e):
    return (
        f"COLMAP placed {e.registered} of {e.total} photos: the others do not overlap "
        "with them, or show another place."
    )


def lens_shift(finding, e):
    return (
        f"All photos are {sure(finding)}shifted alike, by {both(e.shift_px, e)}: the "
        "principal point is wrong, or pixel centres lie half a pixel off."
    )


def lens_distortion(finding, e):
    return (
        f"All photos are {sure(finding)}bent alike, by {both(e.distortion_px, e)} at "
        "the corners: the lens's distortion is wrong."
    )


def blurred(finding, e):
    return (
        f"{100 * e.blurred_share:.0f} % of the photos are {sure(finding)}blurred: they "
        "have less detail than their renders."
    )


def exposure(finding, e):
    return (
        f"Exposure {sure(finding)}changes between photos, by {e.exposure_ev:.2f} stops "
        "(standard deviation)."
    )


def undertrained(finding, e):
    return (
        f"Training was {sure(finding)}too short: each pixel was seen {e.passes:.2g} "
        "times."
    )


SENTENCES = {
    function.__name__: function
    for function in (
        *(camera, motion, sparse, few_views, unregistered, lens_shift),
        *(lens_distortion, blurred, exposure, undertrained),
    )
}


def photos(views):
    """A line on the photos that stand out, if any."""
    odd = [view for view in views if view.stands_out]
    if not odd:
        return []
    named = "; ".join(f"{view.view}: {view.stands_out}" for view in odd[:3])
    more = f"; {len(odd) - 3} more in tables/views.csv" if len(odd) > 3 else ""
    return [f"Photos that stand out: {named}{more}."]


class Gain(NamedTuple):
    """A remedy's gain in this run, in dB with its interval, and its minutes."""

    name: str
    db: float
    low: float
    high: float
    minutes: float
    method: str = ""
    # Whether it is a training that aligned itself on the way.
    on_the_way: bool = False
    test_set: str = ""


# In a table's column `field`, of a training that aligned itself
# (`experiment.tables.rows`).
ON_THE_WAY = "aligned on the way"
# Test sets, the fairest first. Cameras that have moved see a test view elsewhere than
# the given one says, so of these the photos as they are count last.
USUAL = ("oracle", "standard")
FAIR = ("oracle", "aligned_pose", "aligned_pose_gradient", "standard")
OF_GAINS = ("method", "field", "warping", "test_set", "difference_to", "total_time_s")
OF_GAINS += ("difference_db", "difference_low_db", "difference_high_db")


def gains_of(path):
    """The `Gain` of each remedy in a table over the baseline, the model without one.

    Scores are those against the oracle where it is known, else those on held-out
    photos; for a training that aligned itself, with cameras moved to fit the photos.
    """
    table = csv_files.read(path, columns=OF_GAINS)
    known = set(table["test_set"])
    aligned = table["field"].astype(str).str.contains(ON_THE_WAY)
    usual, fair = (
        next((name for name in names if name in known), None) for names in (USUAL, FAIR)
    )
    chosen = table[table["test_set"] == np.where(aligned, fair, usual)]
    gains = []
    for row in chosen.itertuples():
        own = row.method == row.difference_to and row.warping == scores.warping(0)
        if own or pd.isna(row.difference_db):
            continue
        on_the_way = ON_THE_WAY in str(row.field)
        name = scores.row_name(row.method, row.warping)
        if on_the_way and not row.method.startswith("aligned"):
            name = f"{name}, {ON_THE_WAY}"
        ends = (row.difference_low_db, row.difference_high_db)
        took = row.total_time_s / 60, row.method, on_the_way, row.test_set
        gains.append(Gain(name, row.difference_db, *ends, *took))
    return gains


def gain_line(gain, e):
    """A sentence on a remedy's gain in this run; it claims nothing from few views."""
    name, db, low, high, minutes = gain[:5]
    took = f"{minutes:.0f} min" if minutes >= 1 else "under a minute"
    text = f"{name}: {db:+.2f} dB [{low:+.2f}, {high:+.2f}] in {took}"
    if e.test_views < causes.FEW_TEST_VIEWS:
        return f"{text}; {e.test_views} held-out photos are too few to be sure."
    if low > 0 or high < 0:
        return f"{text}."
    return f"{text}: not more than chance."
