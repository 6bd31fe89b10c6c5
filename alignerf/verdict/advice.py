"""What to do first, what that brought where it was measured, and what it cost there."""

from alignerf.verdict import causes

# In dB on courtyard, over plain training of the same seconds, those of one and of two
# trainings (docs/measured/remedies.csv): where poses are off by 1.5 px and objects
# move; where objects alone do. At as many steps: remedies_steps.csv. Twice the steps:
# tradeoff.csv.
LEARNT_DB, LEARNT_TWICE_DB, LONGER_DB = 0.8, 1.6, 0.3
WARPED_MOTION_DB, WARPED_MOTION_TWICE_DB = 0.2, -1.8

# Of several causes the first decides.
ADVICE = (
    ("few_views", "take more photos: 20 or more that overlap."),
    ("unregistered", "take photos between those that are left out and the others."),
    ("sparse", "take more photos between those you have. Warping would not help."),
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
        "learn the cameras with the scene (a method with refine: {}), or put them "
        "right by the flow (rounds: 2, changes: cameras). On the demo's scene learning "
        f"them brought {LEARNT_DB} dB in the seconds of one training, "
        f"{LEARNT_TWICE_DB} dB in those of two.",
    ),
    (
        "motion",
        "train longer, then warp the photos once (rounds: 1). Where only objects move "
        f"in the demo's scene, warping brought {WARPED_MOTION_DB} dB at as many steps, "
        f"and lost {-WARPED_MOTION_TWICE_DB} dB to a training as long as both.",
    ),
)
# Causes whose remedy is what a warping round does.
REMEDIED = ("motion",)


def of(e, findings, gains=()):
    """What to do first; a remedy that this run tried in vain is not recommended."""
    named = {finding.cause for finding in findings}
    for cause, text in ADVICE:
        if cause in named and not (cause in REMEDIED and in_vain(e, gains)):
            anew = cause == "sparse" and "camera" in named
            return f"{text} Have their poses found anew, too." if anew else text
    if in_vain(e, gains):
        return (
            "leave the photos as they are: this run warped them, and that brought no "
            "more than chance."
        )
    if causes.misaligned(e):
        return "warp the photos once (rounds: 1), and look at what remains."
    return "nothing about alignment. For sharper renders take more steps."


def in_vain(e, gains):
    """Whether this run warped photos, and enough views say that nothing came of it."""
    lows = [low for name, _, low, _, _ in gains if "warped" in name]
    return bool(lows) and e.test_views >= causes.FEW_TEST_VIEWS and max(lows) <= 0
