"""Training was too short, or had smaller photos."""

from alignerf.causes import base, shift

# What twice the steps brought on courtyard, in dB (docs/measured/tradeoff.csv).
LONGER_DB = 0.3

# What renders of too short a training do not tell: they are blurred, which moves flows.
EXPLAINS = ("camera", "motion", "sparse", "lens_shift", "lens_distortion", "floaters")
EXPLAINS += ("blurred", "tone", "exposure")
SPOILS = "training was too short"

OURS = base.Cause(
    name="undertrained",
    order=(10, 5, 1),
    label="length of training",
    unit="epochs",
    value=lambda e: e.epochs,
    limit=lambda e: shift.FEW_EPOCHS,
    more_is_better=True,
    explains=EXPLAINS,
    explains_now=lambda e: shift.too_short(e) and not shift.known_crops(e),
    spoils=SPOILS,
    looked_for=lambda e: not e.judged,
    called="trained {probably}too short",
    sentence="Training was {probably}too short: each pixel was seen {value:.2g} times.",
    advice="train longer first: more steps, or budget_min. Twice the steps brought "
    f"{LONGER_DB} dB on the demo's scene.",
)
OTHERS = base.Cause(
    name="undertrained_renders",
    order=(12, 0, 0),
    label="length of training, by its renders",
    unit="of the photos' detail",
    value=shift.detail,
    limit=lambda e: shift.MIN_DETAIL,
    more_is_better=True,
    decide=lambda e: (
        (shift.detail(e), False) if e.judged and shift.too_short(e) else None
    ),
    detectable=lambda e: not shift.explained_by_poses(e),
    looked_for=lambda e: bool(e.judged),
    explains=EXPLAINS,
    spoils=SPOILS,
    called="trained {probably}too short",
    sentence="Training was {probably}too short: renders have {value:.2g} of their "
    "photos' detail, at two to four pixels, and matches find no wrong poses.",
    advice="train longer first.",
    advice_external="train longer first, then judge again: blurred renders do not "
    "show misalignment.",
)
SMALLER = base.Cause(
    name="half_size",
    order=(16, 5.5, 1.5),
    label="size of the training photos",
    unit="of the finest octave",
    value=shift.finest,
    limit=lambda e: shift.MIN_FINEST,
    more_is_better=True,
    explains=("motion",),
    spoils="renders are of smaller photos",
    called="training {probably}had smaller photos",
    sentence="Training {probably}had smaller photos than these: renders lack the "
    "finest octave of detail ({value:.2g} of the next).",
    advice="train at the size of the photos (downscale).",
    advice_external="train with photos of the size that is judged, or judge with those "
    "that were trained on: `-r 1` or --downscale-factor 1 of many programs.",
    looked_for=lambda e: bool(e.judged),
    decide=lambda e: SMALLER.beyond(e) if e.judged else None,
)
CAUSE = [OURS, OTHERS, SMALLER]
