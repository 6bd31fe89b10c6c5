"""Training was too short, or had smaller photos."""

from alignerf.causes import base
from alignerf.causes.shared import misalignment

# What twice the steps brought on courtyard, in dB (docs/measured/tradeoff.csv).
LONGER_DB = 0.3

# What renders of too short a training do not tell: they are blurred, which moves flows.
EXPLAINS = ("camera", "motion", "sparse", "lens_shift", "lens_distortion", "floaters")
EXPLAINS += ("blurred", "tone", "exposure")
SPOILS = "training was too short"


def find_ours(e):
    """Of a training of ours, by how often it has seen each pixel."""
    if e.judged:
        return None
    blind = misalignment.too_short(e) and not misalignment.known_crops(e)
    least = misalignment.FEW_EPOCHS
    return base.beyond(e.epochs, least, more_is_better=True, explains=blind)


def find_others(e):
    """Of another program's, by its renders, unless poses explain these."""
    if not e.judged:
        return None
    return base.Finding(
        misalignment.detail(e),
        misalignment.MIN_DETAIL,
        False if misalignment.too_short(e) else None,
        more_is_better=True,
        detectable=not misalignment.explained_by_poses(e),
    )


def find_smaller(e):
    """Renders of another program that lack the photos' finest octave."""
    if not e.judged:
        return None
    finest, least = misalignment.finest(e), misalignment.MIN_FINEST
    return base.beyond(finest, least, more_is_better=True)


OURS = base.Cause(
    name="undertrained",
    label="length of training",
    unit="epochs",
    find=find_ours,
    explains=EXPLAINS,
    spoils=SPOILS,
    called="trained {probably}too short",
    sentence="Training was {probably}too short: each pixel was seen {value:.2g} times.",
    advice="train longer first: more steps, or budget_min. Twice the steps brought "
    f"{LONGER_DB} dB on the demo's scene.",
)
OTHERS = base.Cause(
    name="undertrained_renders",
    label="length of training, by its renders",
    unit="of the photos' detail",
    find=find_others,
    explains=EXPLAINS,
    spoils=SPOILS,
    called="trained {probably}too short",
    sentence="Training was {probably}too short: renders have {value:.2g} of their "
    "photos' detail, at two to four pixels, and matches find no wrong poses.",
    advice="train longer first, then judge again: blurred renders do not "
    "show misalignment.",
)
SMALLER = base.Cause(
    name="half_size",
    label="size of the training photos",
    unit="of the finest octave",
    find=find_smaller,
    explains=("motion",),
    spoils="renders are of smaller photos",
    called="training {probably}had smaller photos",
    sentence="Training {probably}had smaller photos than these: renders lack the "
    "finest octave of detail ({value:.2g} of the next).",
    advice="train with photos of the size that is judged, or judge with those "
    "that were trained on: `-r 1` or --downscale-factor 1 of many programs.",
)
CAUSE = [OURS, OTHERS, SMALLER]
