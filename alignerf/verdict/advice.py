"""The remedy to try first, with its measured gain and cost."""

import math

from alignerf.files import provenance
from alignerf.metrics import pairs
from alignerf.verdict import causes, judged, remedies, shift

# In dB on courtyard, over plain training of the same seconds, those of one and of two
# trainings (docs/measured/on_the_way.csv): where poses are off by 1.5 px and objects
# move. Where objects alone do (remedies.csv); at as many steps: remedies_steps.csv.
# Twice the steps: tradeoff.csv.
ALIGNED_DB, ALIGNED_TWICE_DB, LONGER_DB = 1.0, 1.8, 0.3
WARPED_MOTION_DB, WARPED_MOTION_TWICE_DB = 0.2, -1.8

# Of several causes the first decides: those come first that a longer training, or work
# at the desk, cures; new photos come last.
ADVICE = (
    (
        "undertrained",
        "train longer first: more steps, or budget_min. Twice the steps brought "
        f"{LONGER_DB} dB on the demo's scene.",
    ),
    ("lens_shift", "check pixel centres and principal point of the given cameras."),
    ("lens_distortion", "calibrate the lens anew, or let COLMAP find it."),
    ("blurred", "leave out the blurred photos, see tables/views.csv."),
    ("exposure", "fix the exposure, or even it out before training."),
    (
        "camera",
        "align on the way (a method with align: {}): one training that puts its "
        f"cameras right as it goes. On the demo's scene it brought {ALIGNED_DB} dB in "
        f"the seconds of one training, {ALIGNED_TWICE_DB} dB in those of two.",
    ),
    (
        "motion",
        "train longer, then warp the photos once (rounds: 1). Where only objects move "
        f"in the demo's scene, warping brought {WARPED_MOTION_DB} dB at as many steps, "
        f"and lost {-WARPED_MOTION_TWICE_DB} dB to a training as long as both.",
    ),
    ("sparse", "take more photos between those you have. Warping would not help."),
    ("unregistered", "take photos between those that are left out and the others."),
    ("few_views", "take more photos: 20 or more that overlap."),
)
# Where another program was trained: `align` is a method of ours.
OF_OTHERS = (
    "put its cameras right in a round: rounds: 1 and changes: cameras of this method, "
    "or take those of one training of ours (a method with align: {})."
)
# Where the poses came with the photos, COLMAP finds others: on a phone's capture they
# were 0.9 to 3.5 dB better than the phone's own (docs/measured/on_the_way_real.csv).
ANEW = (
    "let COLMAP find the poses anew, from a folder of the photos alone: "
    '`make photos FOLDER=photos_alone PHOTOS="--name another"`.'
)
# Where matches between photos say how cameras have to move.
ADJUSTED = (
    "adjust the cameras before training: `poses: adjusted` in the config, or a method "
    "with adjust: true. Half a minute of bundle adjustment, without a training."
)
# Where alignment cannot be told, without windows and with them.
UNSEEN = "add `windows: {}` to the config, or make photos less small (downscale)."
LARGER = "make photos less small (downscale), or train windows longer (windows.steps)."
WIDER = (
    "cut more windows of each photo, `windows: { count: 4 }` in the config, until five "
    "held-out photos have one; or make photos less small (downscale)."
)
# Causes that say nothing of alignment where photos are too few to learn geometry from.
UNTOLD = ("motion",)
# Causes whose remedy is what a warping round does.
REMEDIED = ("motion",)
# Causes that alignment on the way puts right, where it pays.
ALIGNED = ("camera", "motion")


def advise(e, findings, gains=()):
    """The remedy to try first; never one that this run has tried in vain."""
    if e.pairs.stops:
        return pairs.advice(e.pairs)
    if e.judged:
        return judged.advise(e, findings)
    named = {finding.cause for finding in findings}
    if "sparse" in named:
        named -= set(UNTOLD)
    if any(finding.cause == "sparse" and finding.sure for finding in findings):
        # What is only probable then is seen by bad renders; poses are by points, too.
        named -= {one.cause for one in findings if not one.sure} - {"camera"}
    for cause, text in ADVICE:
        if cause not in named or (cause in REMEDIED and in_vain(e, gains)):
            continue
        if cause == "camera":
            more = " And take more photos between those you have." * ("sparse" in named)
            return of_camera(e, gains, camera_text(e)) + more
        return (cause in ALIGNED and of_tried(e, gains)) or text
    if in_vain(e, gains):
        return (
            "leave the photos as they are: this run warped them, and that brought no "
            "more than chance."
        )
    if tried := of_tried(e, gains, only_paying=not shift.misaligned(e)):
        return tried
    if shift.misaligned(e):
        return f"{camera_text(e)} The cause is not known: look at what remains."
    if not shift.tells(e):
        said = shift.of_windows_say(e)
        return UNSEEN if said is None else WIDER if said == "few" else LARGER
    return "nothing about alignment. For sharper renders take more steps."


def camera_text(e):
    """Advice where cameras are off; only other programs do not say what they saw."""
    return OF_OTHERS if math.isnan(e.passes) else dict(ADVICE)["camera"]


def of_camera(e, gains, text):
    """Advice where poses are off; text: what holds where this run has tried nothing."""
    own = of_tried(e, gains)
    if causes.by_matches(e) and not own:
        return ADJUSTED
    if not e.poses_given:
        return own or text
    if any(pays(e, gain) for gain in gains if remedies.is_on_the_way(gain)):
        return f"{ANEW} Until then {own}"
    # What was tried in vain is not offered beside it.
    return ANEW if own else f"{ANEW} Or {text}"


def pays(e, gain):
    """Whether a remedy's gain is significant, on enough held-out photos.

    Thousands of matches that a correction has not seen come before a few photos: where
    they are twice as near it pays, where they are further off it does not.

    Scores on the photos as they are say nothing of moved cameras.
    """
    if gain.matches and gain.matches["halved"] and not gain.high < 0:
        return True
    if gain.matches and gain.matches["worse"]:
        return False
    fair = not (gain.on_the_way and gain.test_set == "standard")
    return fair and e.test_views >= shift.FEW_TEST_VIEWS and gain.low > 0


def of_tried(e, gains, *, only_paying=False):
    """Advice where this run has aligned itself on the way, else nothing."""
    tried = [gain for gain in gains if remedies.is_on_the_way(gain)]
    if not tried:
        return ""
    best = max(tried, key=lambda gain: (pays(e, gain), gain.db))
    if best.cameras_moved == 0:
        # Nothing is gained by cameras that are those given.
        return (
            f"leave the cameras as given: {best.method} looked at them, and moved none."
        )
    if pays(e, best):
        return (
            f"take the cameras of {best.method}, which this run has put right: "
            f"`{provenance.export_command()}`."
        )
    if only_paying or e.test_views < shift.FEW_TEST_VIEWS:
        return ""
    return (
        f"leave cameras and photos as given: {best.method} put right what it saw, and "
        "that brought no more than chance. Train longer."
    )


def in_vain(e, gains):
    """Whether this run warped photos without a gain, by enough views.

    A remedy that also moves cameras is for `of_tried` to judge.
    """
    lows = [gain.low for gain in gains if gain.warped and not gain.on_the_way]
    return bool(lows) and e.test_views >= shift.FEW_TEST_VIEWS and max(lows) <= 0
