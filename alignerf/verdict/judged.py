"""The verdict on renders of another program: what else is told, and what to do.

`alignerf.scenes.judged` puts such a scene together; its poses.json says how.
"""

from pathlib import Path
from typing import NamedTuple

from alignerf.experiment.checks import verdict as of_verdict
from alignerf.files import json_files, provenance
from alignerf.verdict import shift

KEYS = dict.fromkeys(("depth", "cameras", "layout", "way"), str)
BEFORE = dict.fromkeys(("flow_train_px", "flow_test_px"), json_files.NUMBER_OR_NONE)
BEFORE |= {"photo_px": json_files.NUMBER}
# Of depth whose unit neither points nor the config has told.
UNKNOWN_UNIT = (
    "Its unit is not known, as the cameras came without points: it was taken for "
    "theirs. If it is another, an export moves cameras too far or too little. "
    '`JUDGE="--depth-scale X"` says it.'
)
DEPTHS = {
    "given": "The renders' own depth was used.",
    "points": "Depth is coarse: that of the points which the cameras came with.",
    "far": "Without depth only a turn and a zoom of a camera are told, not a step to "
    "the side: what a step explains is counted as the rest.",
}


class Judged(NamedTuple):
    """How a scene that is judged was put together.

    depth: a key of DEPTHS; cameras: what told them, `none` where nothing did; layout:
    how the renders lay; before: of a judgement before this one, its name and shifts of
    training and held-out views in px of the photo; None without one. depth_unit: what
    told the unit of given depth, `nothing` where nothing did.
    """

    depth: str
    cameras: str
    layout: str
    before: tuple | None = None
    depth_unit: str | None = None


def read(poses, before=None):
    """`Judged` by the contents of poses.json, or None of another scene.

    before: path of the verdict.json of a judgement before this one, or None.
    """
    if (told := poses.get("judged")) is None:
        return None
    json_files.check(told, KEYS)
    return Judged(
        depth=told["depth"],
        cameras=told["cameras"],
        layout=told["layout"],
        before=before and read_before(Path(before)),
        depth_unit=told.get("depth_unit"),
    )


def read_before(path):
    """(name, px on photos that were trained on, px on held-out ones; None unknown)."""
    found = of_verdict.read(path, {"evidence": dict}, evidence=BEFORE)["evidence"]
    shifts = (found["flow_train_px"], found["flow_test_px"])
    scale = found["photo_px"]
    return path.parent.name, *(px and px * scale for px in shifts)


def lines(e):
    """Sentences on what could not be told, and why."""
    found = [DEPTHS[e.judged.depth]]
    if e.judged.depth_unit == "nothing":
        found[0] += f" {UNKNOWN_UNIT}"
    if e.judged.before:
        found.insert(0, compared(*e.judged.before))
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


def compared(name, train_px, test_px):
    """A sentence on the judgement before; units as of the verdict's own."""
    parts = [
        f"{px:.2g} px on {what}"
        for px, what in (
            (train_px, "photos that were trained on"),
            (test_px, "held-out ones"),
        )
        if px is not None
    ]
    return f"Before, in {name}, it was {', '.join(parts) or 'unknown'}."


# The first cause decides, as in `advice.ADVICE`.
ADVICE = (
    (
        "lens_shift",
        "check pixel centres and principal point in what you gave the program: shifts "
        "of half a pixel come from a wrong origin of pixels.",
    ),
    ("lens_distortion", "calibrate the lens anew, or undistort the photos first."),
    ("blurred", "leave out the blurred photos, see tables/views.csv, and train again."),
    (
        "exposure",
        "fix the exposure, even it out before training, or switch on your program's "
        "appearance model.",
    ),
    (
        "camera",
        "train again with the corrected cameras: `{export}` writes them.",
    ),
    ("motion", "train again on the warped photos: `{export}` writes them."),
    ("sparse", "take more photos between those you have. Warping would not help."),
    ("few_views", "take more photos: 20 or more that overlap."),
)


def put_right(e, text):
    """An advice with the command that exports, or with what an export wants first."""
    if "{export}" not in text:
        return text
    if e.judged.cameras == "none":
        return "give the cameras, too (CAMERAS=...): then they can be corrected."
    if not e.train_views:
        return (
            "render the photos that the program has learnt from, too, and judge again: "
            "only those can be put right."
        )
    return text.format(export=provenance.export_command())


def advise(e, findings):
    """What to do first."""
    named = {finding.cause for finding in findings}
    for cause, text in ADVICE:
        if cause in named:
            return put_right(e, text)
    if shift.misaligned(e):
        return put_right(e, dict(ADVICE)["motion"])
    if not shift.tells(e):
        return "render larger pictures: at this size a shift is too small to be seen."
    return (
        "nothing about alignment. For sharper renders train longer, or a larger model."
    )
