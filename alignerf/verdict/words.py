"""The verdict's sentences in plain words, each with its number; see `report`.

Lengths are in pixels of the original photo: those of the training change with
`downscale`. Where it matters, they are also said for photos of 1600 px of width.
"""

import math

from alignerf.metrics import pairs
from alignerf.verdict import causes, judged, remedies, shift


def measured(e, views, gains=()):
    """Sentences on what was measured: shifts, what could not be told, odd photos."""
    if e.pairs.stops:
        return poses(e)
    lines = alignment(e, gains) + (judged.lines(e) if e.judged else [])
    return [*poses(e), *lines, *photos(views)]


def poses(e):
    """What bundle adjustment says of the cameras, where it was asked."""
    if not e.matches:
        return []
    m = e.matches
    change = f"{length(m.before_px)} -> {length(m.after_px)}"
    if not m.accepted:
        seen = f"matches that it has not seen: {change}"
        return [f"Bundle adjustment finds no better poses than those given ({seen})."]
    what = "corrected before training" if m.applied else "an export corrects them"
    if not (m.applied or e.judged):
        what = "a method with adjust: true, or poses: adjusted, corrects them"
    if e.pairs.stops:
        what = "matches between photos say so"
    off = f"{length(m.pose_error_px)} of the photo (worst view {length(m.worst_px)})"
    verb = "were" if m.applied else "are"
    return [f"Poses {verb} off by {off}: {what}. Held-out matches: {change}."]


def of_photo(px, evidence):
    """A length in px of the training, said in px of the photo."""
    return length(px * evidence.photo_px)


def length(photo_px):
    """A length in px of the photo, with two digits that count."""
    if not math.isfinite(photo_px):
        return "unknown"
    return f"{photo_px:.1f} px" if photo_px >= 0.95 else f"{photo_px:.2f} px"


def wide(photo_px, e):
    """The same where the photo is 1600 px wide, as programs make it for training."""
    return length(photo_px * shift.USUAL_WIDTH_PX / e.photo_width_px)


def sure(finding):
    return "" if finding.sure else "probably "


def headline(e, findings):
    """One line: aligned or not, by how much, and the gravest causes."""
    if e.pairs.stops:
        return f"cannot be told: {pairs.sentence(e.pairs)}."
    kind, named = state(e, findings), [finding.cause for finding in findings]
    what = [
        CALLED[one.cause].format(probably=sure(one))
        for one in findings
        if one.cause in CALLED
    ]
    if kind == "misaligned":
        by = f"misaligned by {length(shift.shift_px(e))}"
        return f"{by}{': ' + ', '.join(what) if what else ''}."
    if kind == "aligned":
        far = f"aligned, as far as {length(shift.limit_px(e))} can show"
        return f"{far}{'; but ' + ', '.join(what) if what else ''}."
    if "sparse" in named:
        if "camera" in named:
            poses = next(word for word in what if word.startswith("poses"))
            return f"{poses}, and photos are too few or too far apart."
        return "too few photos, or too far apart: aligning is no help."
    if shift.few_train(e):
        return "too few photos to say much."
    if shift.too_short(e):
        return "trained too short to tell how well photos are aligned."
    also = f" But {', '.join(what)}." if what else ""
    if not math.isfinite(shift.flow_px(e)):
        return f"cannot be told: no flow from renders to photos is valid.{also}"
    if shift.of_windows_say(e) == "unconfirmed":
        px = length(e.windows.flow_px)
        return f"cannot be told for sure: windows are {px} apart.{also}"
    seen = f"a shift under {length(shift.limit_px(e))} would not be seen"
    return f"cannot be told at this size: {seen}.{also}"


def state(e, findings):
    """The verdict in a word: `aligned`, `misaligned` or `unclear`."""
    named = {finding.cause for finding in findings}
    if e.pairs.stops:
        return "unclear"
    if shift.by_windows(e):
        return "misaligned"
    few = shift.few_train(e)
    short = shift.too_short(e) and not shift.known_windows(e)
    if "sparse" in named or few or short:
        return "unclear"
    if shift.misaligned(e) and not shift.too_short(e):
        return "misaligned"
    return "aligned" if shift.tells(e) else "unclear"


CALLED = {
    "camera": "poses are {probably}off",
    "motion": "the scene {probably}moved",
    "lens_shift": "the principal point is {probably}off",
    "lens_distortion": "the lens is {probably}bent otherwise",
    "blurred": "some photos are {probably}blurred",
    "exposure": "exposure {probably}changes",
    "sparse": "photos are {probably}too few or too far apart",
    "few_views": "photos are few",
    "unregistered": "photos are left out",
    "undertrained": "trained {probably}too short",
    "pairs": "some renders are left out",
}


def alignment(e, gains=()):
    """How far photos and renders are apart, by windows and by whole photos."""
    lines = of_windows(e, gains) if e.windows else []
    parts, scale = [], f"at {shift.USUAL_WIDTH_PX} px of width"
    if math.isfinite(e.flow_train_px):
        parts.append(f"{of_photo(e.flow_train_px, e)} on photos that were trained on")
    if math.isfinite(e.flow_test_px) or not e.judged:
        parts.append(f"{of_photo(e.flow_test_px, e)} on held-out ones")
    limit = e.photo_px * shift.limit_of_training_px(e)
    begins = "Photo and render are shifted by"
    if lines:
        begins = "By the whole photos, trained small, the shift is"
    unseen = f"a shift under {length(limit)} ({wide(limit, e)} {scale})"
    lines.append(f"{begins} {', '.join(parts)}; {unseen} would not be seen.")
    return lines


def of_windows(e, gains):
    """What windows at the photos' own size tell, or why they tell nothing."""
    w, say = e.windows, shift.of_windows_say(e)
    if say in NOTHING_TOLD:
        why = NOTHING_TOLD[say].format(
            passes=f"{w.passes:.2g}",
            photos=w.photos,
            test=w.test_photos,
            apart=length(w.flow_px),
            held_out=length(w.flow_test_px),
        )
        return [f"Windows at the photos' own size tell nothing: {why}"]
    each = f"{w.places} window{'s' * (w.places > 1)} of {w.px} px of each photo"
    interval = f"95 % interval {length(w.low_px)} to {length(w.high_px)}"
    lines = [
        f"At the photos' own size a photo and its render are shifted by "
        f"{length(w.flow_px)} ({interval}), which is {wide(w.flow_px, e)} at "
        f"{shift.USUAL_WIDTH_PX} px of width. That is the median of {w.photos} photos "
        f"that were trained on, in {each}; on {w.test_photos} held-out photos it is "
        f"{length(w.flow_test_px)}."
    ]
    if say == "misaligned":
        lines.append(
            "The true error of the poses is larger than that shift: a model that is "
            "trained with wrong poses hides a part of it."
        )
    if say == "unconfirmed":
        lines.append("Held-out photos do not confirm that shift.")
    moved = [
        getattr(g, "cameras_moved", None) for g in gains if remedies.is_on_the_way(g)
    ]
    # Where no camera has moved, the others are the same once more.
    if math.isfinite(w.corrected_px) and not (moved and set(moved) == {0}):
        lines.append(
            "With the cameras that this run has put right the shift is "
            f"{length(w.corrected_px)}."
        )
    return lines


# Why windows tell nothing.
NOTHING_TOLD = {
    "unknown": "no flow in them is valid.",
    "short": "each of their pixels was seen {passes} times, which is too short.",
    "few": "they lie in {photos} photos to learn from and {test} to judge by.",
    "sparse": "photos that were trained on are {apart} apart, held-out ones "
    "{held_out}. What they show is seen from too few sides to fix its shape.",
}


def camera(finding, e):
    lead, source = f"Poses are {sure(finding)}off: ", causes.source_of_camera(e)
    if source == "windows":
        px = length(e.windows.camera_px)
        return (
            f"{lead}in the windows a moved camera explains {px} of the shift.{added(e)}"
        )
    if source == "matches":
        px = length(e.matches.pose_error_px)
        return f"{lead}bundle adjustment of matches between photos moves them by {px}."
    if source == "points":
        px = of_photo(e.reprojection_px, e)
        where = "points that several photos show lie"
        return f"{lead}{where} {px} from where the cameras expect them."
    px = of_photo(e.camera_px, e)
    return f"{lead}a moved camera explains {px} of the shift.{added(e)}"


def added(e):
    """Where the error was put in on purpose, a low reprojection error is explained."""
    if not e.perturb_px:
        return ""
    px = of_photo(e.perturb_px, e)
    return (
        f" An error of {px} was put in on purpose (perturb_px) after the poses were "
        "found, so that their reprojection error does not show it."
    )


def motion(finding, e):
    return (
        f"The scene {sure(finding)}moved between photos: {100 * e.moved_share:.0f} % "
        "of a photo moves by itself, apart from the camera."
    )


def sparse(finding, e):
    return (
        f"Photos are {sure(finding)}too few or too far apart: those learnt from are "
        f"matched to {e.psnr_train_db:.1f} dB, held-out ones to {e.psnr_test_db:.1f}."
    )


def few_views(finding, e):
    if e.judged:
        count = max(e.train_views, e.test_views)
        return f"{count} renders are few: {shift.FEW_TRAIN_VIEWS} are the least."
    return (
        f"{e.train_views} photos to learn from and {e.test_views} to judge by are few: "
        f"{shift.FEW_TRAIN_VIEWS} and {shift.FEW_TEST_VIEWS} are the least."
    )


def unregistered(finding, e):
    return (
        f"COLMAP placed {e.registered} of {e.total} photos: the others do not overlap "
        "with them, or show another place."
    )


def lens_shift(finding, e):
    return (
        f"All photos are {sure(finding)}shifted alike, by {of_photo(e.shift_px, e)}: "
        "the principal point is wrong, or pixel centres lie half a pixel off."
    )


def lens_distortion(finding, e):
    return (
        f"All photos are {sure(finding)}bent alike, by {of_photo(e.distortion_px, e)} "
        "at the corners: the lens's distortion is wrong."
    )


def blurred(finding, e):
    return (
        f"{100 * e.blurred_share:.0f} % of the photos are {sure(finding)}blurred: they "
        "have less detail than their renders."
    )


def exposure(finding, e):
    return (
        f"Exposure {sure(finding)}changes between photos, by {finding.size:.2f} stops "
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
} | {"pairs": lambda finding, e: f"Left out: {pairs.sentence(e.pairs)}."}


def photos(views):
    """A line on the photos that stand out, if any."""
    odd = [view for view in views if view.stands_out]
    if not odd:
        return []
    named = "; ".join(f"{view.view}: {view.stands_out}" for view in odd[:3])
    more = f"; {len(odd) - 3} more in tables/views.csv" if len(odd) > 3 else ""
    return [f"Photos that stand out: {named}{more}."]
