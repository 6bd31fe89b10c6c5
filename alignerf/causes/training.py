"""Training was too short: pixels have hardly been seen."""

from alignerf.causes import base, shift

# What twice the steps brought on courtyard, in dB (docs/measured/tradeoff.csv).
LONGER_DB = 0.3

CAUSE = base.Cause(
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
