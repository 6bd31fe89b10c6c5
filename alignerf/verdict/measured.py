"""Sentences on what was measured: shifts, cameras, odd photos; what could not be told.

Lengths are in pixels of the original photo. Where it matters, they are also said for
photos of 1600 px of width, as programs make them for training.
"""

import math

from alignerf.causes import shift
from alignerf.causes.base import length

SCALE = f"at {shift.USUAL_WIDTH_PX} px of width"
# Why crops tell nothing.
NOTHING_TOLD = {
    "unknown": "no flow in them is valid.",
    "short": "each of their pixels was seen {w.epochs:.2g} times, which is too short.",
    "few": "they lie in {w.photos} photos to learn from and {w.test_photos} to judge "
    "by.",
    "sparse": "photos that were trained on are {apart} apart, held-out ones "
    "{held_out}. What they show is seen from too few sides to fix its shape.",
}
# Of renders of another program: by the depth that was used.
DEPTHS = {
    "given": "The renders' own depth was used.",
    "points": "Depth is coarse: that of the points which the cameras came with.",
    "far": "Without depth only a turn and a zoom of a camera are told, not a step to "
    "the side: what a step explains is counted as the rest.",
}
# Of depth whose unit neither points nor the config has told.
UNKNOWN_UNIT = (
    " Its unit is not known, as the cameras came without points: it was taken for "
    "theirs. If it is another, an export moves cameras too far or too little. "
    '`JUDGE="--depth-scale X"` says it.'
)


def sentences(e, views, gains=()):
    """All of them. views: `views.View`s; gains: `remedies.Gain`s."""
    if e.pairs.stops:
        return poses(e)
    of_crops = crops(e, gains) if e.crops else []
    of_others = judged(e) if e.judged else []
    odd = [f"{view.view}: {view.stands_out}" for view in views if view.stands_out]
    more = f"; {len(odd) - 3} more in tables/views.csv" if len(odd) > 3 else ""
    photos = [f"Photos that stand out: {'; '.join(odd[:3])}{more}."] if odd else []
    return [*poses(e), *of_crops, whole_photos(e), *of_others, *photos]


def poses(e):
    """What bundle adjustment says of the cameras, where it was asked."""
    if not e.matches:
        return []
    m = e.matches
    change = f"{length(m.before_px)} -> {length(m.after_px)}"
    if not m.accepted:
        seen = f"matches that it has not seen: {change}"
        return [f"Bundle adjustment finds no better poses than those given ({seen})."]
    if e.pairs.stops:
        what = "matches between photos say so"
    elif m.applied:
        what = "corrected before training"
    elif e.judged:
        what = "an export corrects them"
    else:
        what = "a method with adjust: true, or poses: adjusted, corrects them"
    off = f"{length(m.pose_error_px)} of the photo (worst view {length(m.worst_px)})"
    verb = "were" if m.applied else "are"
    return [f"Poses {verb} off by {off}: {what}. Held-out matches: {change}."]


def wide(photo_px, e):
    """A length where the photo is 1600 px wide."""
    return length(photo_px * shift.USUAL_WIDTH_PX / e.photo_width_px)


def whole_photos(e):
    """How far photos and renders are apart at the size of training."""
    parts = []
    if math.isfinite(e.flow_train_px):
        px = length(e.photo_px * e.flow_train_px)
        parts.append(f"{px} on photos that were trained on")
    if math.isfinite(e.flow_test_px) or not e.judged:
        parts.append(f"{length(e.photo_px * e.flow_test_px)} on held-out ones")
    limit = e.photo_px * shift.told_px(e.overfit_px)
    begins = "Photo and render are shifted by"
    if e.crops:
        begins = "By the whole photos, trained small, the shift is"
    unseen = f"a shift under {length(limit)} ({wide(limit, e)} {SCALE})"
    return f"{begins} {', '.join(parts)}; {unseen} would not be seen."


def crops(e, gains):
    """What crops at the photos' own size tell, or why they tell nothing."""
    w, say = e.crops, shift.of_crops_say(e)
    apart, held_out = length(w.flow_px), length(w.flow_test_px)
    if say in NOTHING_TOLD:
        why = NOTHING_TOLD[say].format(w=w, apart=apart, held_out=held_out)
        return [f"Crops at the photos' own size tell nothing: {why}"]
    each = f"{w.places} crop{'s' * (w.places > 1)} of {w.px} px of each photo"
    interval = f"95 % interval {length(w.low_px)} to {length(w.high_px)}"
    lines = [
        f"At the photos' own size a photo and its render are shifted by {apart} "
        f"({interval}), which is {wide(w.flow_px, e)} {SCALE}. That is the median of "
        f"{w.photos} photos that were trained on, in {each}; on {w.test_photos} "
        f"held-out photos it is {held_out}."
    ]
    if say == "misaligned":
        lines.append(
            "The true error of the poses is larger than that shift: a model that is "
            "trained with wrong poses hides a part of it."
        )
    if say == "unconfirmed":
        lines.append("Held-out photos do not confirm that shift.")
    moved = {gain.cameras_moved for gain in gains if gain.in_loop}
    # Where no camera has moved, the others are the same once more.
    if math.isfinite(w.corrected_px) and moved != {0}:
        px = length(w.corrected_px)
        lines.append(f"With the cameras that this run has corrected the shift is {px}.")
    return lines


def judged(e):
    """Of renders of another program: what could not be told, and why."""
    unit = UNKNOWN_UNIT * (e.judged.depth_unit == "nothing")
    found = [DEPTHS[e.judged.depth] + unit]
    if e.judged.before:
        name, *shifts = e.judged.before
        kinds = ("photos that were trained on", "held-out ones")
        parts = [
            f"{px:.2g} px on {kind}"
            for px, kind in zip(shifts, kinds, strict=True)
            if px is not None
        ]
        found.insert(0, f"Before, in {name}, it was {', '.join(parts) or 'unknown'}.")
    if e.judged.cameras == "none":
        found.append(
            "No cameras were given: a field of view was assumed, and what is called a "
            "camera's share is a guess by it."
        )
    if not e.test_views:
        found.append(
            "No renders of held-out photos were given: a model can hide wrong poses in "
            "the photos that it has learnt. Render those that it has not seen, too."
        )
    return found
