"""Sentences on what was measured: shifts, cameras, odd photos; what could not be told.

Lengths are in pixels of the original photo.
"""

import math

from alignerf.causes import camera
from alignerf.causes.base import length
from alignerf.causes.shared import misalignment
from alignerf.io import provenance
from alignerf.tables import columns
from alignerf.verdict import views as of_views

# Why crops tell nothing.
NOTHING_TOLD = {
    "unknown": "no flow in them is valid.",
    "short": "each of their pixels was seen {w.epochs:.2g} times, which is too short.",
    "few": "they lie in {w.photos} photos to learn from and {w.test_photos} to judge "
    "by.",
    "sparse": "photos that were trained on are {apart} apart, held-out ones "
    "{held_out}. What they show is seen from too few sides to fix its shape.",
}
# Of held-out renders, in `evidence.SCORES`: their names and forms.
HEADINGS = columns.TABLES["misalignment"].columns
SCORES = {key: (HEADINGS[key].heading, HEADINGS[key].form) for key in columns.METRICS}
SCORES |= {"sharpness": ("sharpness (photo: 1)", ".2f")}
# Of renders of another program: by the depth that was used.
DEPTHS = {
    "given": "The renders' own depth was used.",
    "points": "Depth is coarse, of sparse points: what comes and goes is not told.",
    "far": "Without depth only a camera's rotation and focal length are told, not its "
    "translation, which counts as residual flow, nor what comes and goes.",
}


def sentences(e, views):
    """All of them. views: `views.View`s."""
    if e.pairs.stops:
        return poses(e)
    of_crops = crops(e) if e.crops else []
    of_others = judged(e) if e.judged else []
    odd = [f"{view.view}: {view.stands_out}" for view in of_views.odd(views)]
    more = f"; {len(odd) - 3} more in tables/views.csv" if len(odd) > 3 else ""
    photos = [f"Photos that stand out: {'; '.join(odd[:3])}{more}."] if odd else []
    photos = farthest(e, views) + photos
    return [*poses(e), *of_crops, whole_photos(e), *of_others, *photos, *perturbed(e)]


def farthest(e, views):
    """The photos that are misaligned most, where photos are misaligned at all."""
    if not misalignment.misaligned(e):
        return []
    known = [view for view in views if math.isfinite(view.flow_px)]
    first = sorted(known, key=lambda view: -view.flow_px)[:3]
    told = [f"{view.view} ({length(e.photo_px * view.flow_px)})" for view in first]
    return [f"Farthest off: {', '.join(told)}."] if told else []


def perturbed(e):
    """What a config has done to the poses on purpose."""
    px = length(e.photo_px * e.perturb_px)
    by = "" if e.perturb_by == "rotation" else f", perturb_by: {e.perturb_by}"
    told = f"The config perturbs the poses by {px} (perturb_px{by})."
    return [told] * bool(e.perturb_px)


def poses(e):
    """What bundle adjustment says of the cameras, where it was asked."""
    if not e.matches:
        return []
    m = e.matches
    change = f"{length(m.before_px)} -> {length(m.after_px)}"
    if not m.accepted:
        return [f"Bundle adjustment finds no better poses (held-out matches {change})."]
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
    # Fixes say how near matches are by them.
    told = not e.pairs.stops and any(gain.matches for gain in e.tried)
    found = "" if told else f" Held-out matches: {change}."
    is_told = m.applied or m.named or misalignment.poses_off(e)
    if misalignment.is_scattered(e) and not is_told:
        return [f"By matches, no cameras fit: the nearest are {off} away.{found}"]
    if not m.applied and camera.find(e).sure is not None:
        off += f", by flow {length(camera.find(e).value)}"
    named = "; ".join(m.named) or f"poses {verb} off by {off}"
    return [f"By matches, {named}: {what}.{found}"]


def whole_photos(e):
    """How far photos and renders are apart at the size of training."""
    parts = []
    if math.isfinite(e.flow_train_px):
        px = length(e.photo_px * e.flow_train_px)
        parts.append(f"{px} on training photos")
    if math.isfinite(e.flow_test_px) or not e.judged:
        parts.append(f"{length(e.photo_px * e.flow_test_px)} on held-out ones")
    limit = e.photo_px * misalignment.told_px(e.overfit_px)
    begins = "The misalignment of photo and render is"
    if e.crops:
        begins = "By whole photos, trained small, the misalignment is"
    unseen = f"under {length(limit)} it would not be seen"
    return f"{begins} {', '.join(parts)}; {unseen}."


def crops(e):
    """What crops at the photos' own size tell, or why they tell nothing."""
    w, say = e.crops, misalignment.of_crops_say(e)
    apart, held_out = length(w.flow_px), length(w.flow_test_px)
    if say in NOTHING_TOLD:
        why = NOTHING_TOLD[say].format(w=w, apart=apart, held_out=held_out)
        return [f"Crops at the photos' own size tell nothing: {why}"]
    each = f"{w.places} crop{'s' * (w.places > 1)} of {w.px} px of each photo"
    interval = f"95 % interval {length(w.low_px)} to {length(w.high_px)}"
    lines = [
        f"At the photos' own size the misalignment is {apart} ({interval}), the median "
        f"of {w.photos} training photos, in {each}; on {w.test_photos} held-out photos "
        f"it is {held_out}."
    ]
    if say == "misaligned":
        lines.append(
            "The poses are off by more than that: a model that is trained with wrong "
            "poses hides a part of their error."
        )
    if say == "unconfirmed":
        lines.append("Held-out photos do not confirm it.")
    moved = {gain.cameras_moved for gain in e.tried if gain.in_loop}
    # Where no camera has moved, the others are the same once more.
    if math.isfinite(w.corrected_px) and moved != {0}:
        px = length(w.corrected_px)
        lines.append(f"With the cameras that this run has corrected it is {px}.")
    return lines


def compared(before, now):
    """What `evidence.SCORES` of the same held-out views were and are; else nothing.

    By wrong cameras PSNR falls with every pixel that a sharp render is off by, so that
    it does not stand alone.
    """
    same = ("views", "width_px")
    if not (before and now) or any(before[key] != now[key] for key in same):
        return ""
    parts = [
        f"{name} {before[key]:{form}} -> {now[key]:{form}}"
        for key, (name, form) in SCORES.items()
        if before.get(key) is not None and math.isfinite(now.get(key, math.nan))
    ]
    return f" Held-out photos: {', '.join(parts)}." if parts else ""


def judged(e):
    """Of renders of another program: what could not be told, and why."""
    found = [DEPTHS[e.judged.depth]]
    if e.judged.depth != "given" and e.judged.cameras != "none":
        option = provenance.typed("DEPTH=folder", "--depth folder")
        found[0] += f" Renders' own depth is given with {option}."
    if e.judged.before:
        name, *shifts, scores = e.judged.before
        kinds = ("training photos", "held-out ones")
        parts = [
            f"{px:.2g} px on {kind}"
            for px, kind in zip(shifts, kinds, strict=True)
            if px is not None
        ]
        told = f"Before, in {name}, it was {', '.join(parts) or 'unknown'}."
        found.insert(0, told + compared(scores, e.judged.scores))
    if e.judged.cameras == "none":
        found.append(
            "No cameras were given: a field of view was assumed, so that the camera's "
            "part of the misalignment is a guess."
        )
    if not e.test_views:
        found.append(
            "No renders of held-out photos were given: a model can hide wrong poses in "
            "its training photos. Render views that it has not seen, too."
        )
    return found
