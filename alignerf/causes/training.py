"""Training was too short, or had smaller photos."""

from alignerf.causes import base, blur, camera, exposure, lens
from alignerf.causes.shared import misalignment

# What twice the steps brought on courtyard, in dB (docs/measured/tradeoff.csv).
LONGER_DB = 0.3

# What renders of too short a training do not tell: they are blurred, which moves flows.
EXPLAINS = ("camera", "motion", "sparse", "lens_shift", "lens_distortion", "floaters")
EXPLAINS += ("transients", "blurred", "tone", "exposure")
SPOILS = "training was too short"


def find_ours(e):
    """Of a training of ours, by how often it has seen each pixel."""
    if e.judged:
        return None
    blind = misalignment.too_short(e) and not misalignment.known_crops(e)
    least = misalignment.FEW_EPOCHS
    return base.beyond(e.epochs, least, more_is_better=True, explains=blind)


def find_others(e):
    """Of another program's, by its renders, unless poses explain these.

    Much softer ones are of no other fault; of softer ones no other may be known.
    """
    if not e.judged:
        return None
    short, least = misalignment.too_short(e), misalignment.SOFT_DETAIL
    found = short or (misalignment.is_soft(e, least) and is_unexplained(e))
    return base.Finding(
        misalignment.detail(e),
        least,
        short if found else None,
        more_is_better=True,
        detectable=not misalignment.explained_by_poses(e),
    )


def is_unexplained(e):
    """Whether nothing else is known that makes renders soft."""
    known = blur.CAUSE.find(e).sure is not None or lens.by_matches(e)
    known = known or e.exposure_ev > exposure.EXPOSURE_EV
    return not known and camera.denied(e) is not False


def find_smaller(e):
    """Renders of another program that lack the photos' finest octave."""
    if not e.judged or e.judged.trained_px:
        return None
    finest, least = misalignment.finest(e), misalignment.MIN_FINEST
    tells = misalignment.tells_size(e)
    found = base.beyond(finest, least, more_is_better=True, where=tells)
    return found._replace(detectable=tells)


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
