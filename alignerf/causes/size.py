"""Renders are of smaller photos than these: their detail ends an octave early."""

from alignerf.causes import base, shift

CAUSE = base.Cause(
    name="half_size",
    order=(16, 5.5, 1.5),
    label="size of the photos that were trained on",
    unit="of the finest octave",
    value=shift.finest,
    limit=lambda e: shift.MIN_FINEST,
    more_is_better=True,
    explains=("motion",),
    spoils="renders are of smaller photos",
    called="training {probably}had smaller photos",
    sentence="Training {probably}had smaller photos than these: the finest detail of "
    "renders is {value:.2g} of the coarser.",
    advice="train at the size of the photos (downscale).",
    advice_external="train with photos of the size that is judged, or judge with those "
    "that were trained on: `-r 1` or --downscale-factor 1 of many programs.",
    looked_for=lambda e: bool(e.judged),
    decide=lambda e: CAUSE.beyond(e) if e.judged else None,
)
