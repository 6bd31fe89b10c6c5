"""Renders are of smaller photos than these: their detail ends an octave early."""

from alignerf.causes import base

# Detail of renders over photos in the finest octave, over that in the third. Renders of
# half the size have 0.35 of it.
FINEST = 0.3


def finest(e):
    """The finest octave's detail over the third's."""
    return e.octaves[0] / max(e.octaves[2], 1e-6)


CAUSE = base.Cause(
    name="half_size",
    order=(16, 5.5, 1.5),
    label="size of the photos that were trained on",
    unit="of the finest octave",
    value=finest,
    limit=lambda e: FINEST,
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
