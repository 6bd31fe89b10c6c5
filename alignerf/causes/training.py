"""Training was too short: pixels have hardly been seen."""

from alignerf.causes import base, shift

# What twice the steps brought on courtyard, in dB (docs/measured/tradeoff.csv).
LONGER_DB = 0.3

OURS = base.Cause(
    name="undertrained",
    order=(10, 5, 1),
    label="length of training",
    unit="epochs",
    value=lambda e: e.epochs,
    limit=lambda e: shift.FEW_EPOCHS,
    more_is_better=True,
    looked_for=lambda e: not e.judged,
    says=lambda e: f"{base.number(e.epochs)} epochs, {shift.FEW_EPOCHS} are enough",
    called="trained {probably}too short",
    sentence="Training was {probably}too short: each pixel was seen {value:.2g} times.",
    advice="train longer first: more steps, or budget_min. Twice the steps brought "
    f"{LONGER_DB} dB on the demo's scene.",
)
OTHERS = base.Cause(
    name="undertrained_renders",
    order=(12, 0, 0),
    label="length of training, by its renders",
    unit="times the renders' detail",
    value=lambda e: e.detail_median,
    limit=lambda e: shift.SOFT_DETAIL,
    decide=lambda e: (
        (e.detail_median, False) if e.judged and shift.too_short(e) else None
    ),
    detectable=lambda e: not shift.explained_by_poses(e),
    looked_for=lambda e: bool(e.judged),
    says=lambda e: (
        f"photos have {base.number(e.detail_median)} times the fine detail of "
        f"renders, {shift.SOFT_DETAIL:g} is too much"
    ),
    called="trained {probably}too short",
    sentence="Training was {probably}too short: photos have {value:.2g} times the fine "
    "detail of the renders, and matches find no wrong poses.",
    advice="train longer first.",
    advice_external="train longer first, then judge again: blurred renders tell "
    "nothing of alignment.",
)
CAUSE = [OURS, OTHERS]
