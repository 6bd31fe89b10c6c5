"""Brightness changes from photo to photo, or slowly over all of them; or all renders
of another program have another than their photos.
"""

import math

from alignerf.causes import base
from alignerf.causes.shared import misalignment

# Standard deviation over views, of photos over their renders; and of photos over one
# another. A slow change is learnt as a colour that depends on the direction, so that
# no render shows it, and does less harm: a phone that exposes as it goes comes to 0.13.
EXPOSURE_EV, SHARED_EV = 0.084, 0.16
# A splat's flows stumble from so much of the first on; leaves that move have 0.11.
BENDS_EV = 0.126
# What renders leave of the difference with red and blue exchanged: those in BGR up to
# 0.67 of it, all others 1.6 times as much and more.
EXCHANGED = 0.9
# Of a curve common to all renders, in stops: at most 0.05 where nothing is wrong. Half
# a stop makes flows stumble.
TONE_EV, STRONG_EV = 0.14, 0.5


def find_changes(e):
    """How much exposure changes in stops, by what shows it best.

    Depth of a training that was too short does not say which points photos share, nor
    does that of sparse points: one capture with right exposure had 0.17 by these.
    """
    told = [(e.exposure_ev, EXPOSURE_EV)]
    coarse = e.judged and e.judged.depth != "given"
    if math.isfinite(e.shared_ev) and not (coarse or misalignment.too_short(e)):
        told.append((e.shared_ev, SHARED_EV))
    known = [one for one in told if math.isfinite(one[0])]
    shown = max(known or told, key=lambda one: one[0] / one[1])
    # What points share is blurred by wrong poses; what all renders show is not.
    strong = e.exposure_ev > 2 * EXPOSURE_EV
    untold = "" if known else "photos and renders are black, or clipped"
    return base.beyond(
        *shown, explains=e.exposure_ev > BENDS_EV, stands=strong, spoilt=untold
    )


def disturbs(e):
    """Whether brightness makes flows stumble, by what changes or what all have."""
    found = filter(None, (find_changes(e), find_tone(e)))
    return any(one.sure is not None and one.explains for one in found)


def find_channels(e):
    """Whether renders of another program are in BGR.

    Three gains, and a curve, are tried only where one gain does not leave less once red
    and blue are exchanged.
    """
    if not e.judged:
        return None
    found = True if e.exchanged < EXCHANGED else None
    measured = f"exchanged, they leave {base.number(e.exchanged)} of the difference"
    return base.Finding(
        e.exchanged, EXCHANGED, found, more_is_better=True, measured=measured
    )


def find_tone(e):
    """A curve common to all renders of another program, by its largest part in stops.

    More than a gamma has to be off: blurred renders have less contrast, too.
    """
    if not e.judged:
        return None
    side = "darker" if e.tone_gain_ev > 0 else "brighter"
    parts = (
        (abs(e.tone_gain_ev), f"{abs(e.tone_gain_ev):.2f} stops {side}"),
        (abs(e.tone_gamma - 1), f"a gamma of {e.tone_gamma:.2f}"),
        (e.tone_white_ev, f"{e.tone_white_ev:.2f} stops between color channels"),
    )
    most = max((ev for ev, _ in parts if math.isfinite(ev)), default=math.nan)
    return base.beyond(
        most,
        TONE_EV,
        said=", ".join(text for ev, text in parts if ev > TONE_EV),
        explains=most > STRONG_EV,
        stands=max(e.tone_white_ev, abs(e.tone_gain_ev)) > 2 * TONE_EV
        and not find_channels(e).sure,
    )


CHANGES = base.Cause(
    name="exposure",
    label="exposure",
    unit="stops",
    find=find_changes,
    explains=("sparse", "motion", "floaters"),
    spoils="brightness changes between photos",
    called="exposure {probably}changes",
    sentence="Exposure {probably}changes between photos, by {value:.2f} stops "
    "(standard deviation).",
    advice="lock the exposure, or even it out before training.",
    advice_external="lock the exposure, even it out before training, or enable your "
    "program's appearance model.",
    page="howto/fix.md#too-few-blurred-uneven-photos",
)
TONE = base.Cause(
    name="tone",
    label="tone curve of the renders",
    unit="stops",
    find=find_tone,
    explains=("sparse", "motion", "floaters"),
    spoils="renders have another tone curve",
    called="renders {probably}have another tone curve than their photos",
    sentence="All renders {probably}differ from their photos: {said}.",
    advice="write the renders in sRGB, as the photos are, and judge again: "
    "linear colors, or a gamma curve applied twice, shift all of them.",
)
CHANNELS = base.Cause(
    name="channels",
    label="red and blue of the renders",
    unit="of the difference",
    find=find_channels,
    explains=(
        *TONE.explains,
        "tone",
        "transients",
        "exposure",
        "camera",
        "lens_shift",
        "lens_distortion",
    ),
    spoils="red and blue are exchanged",
    called="red and blue are exchanged",
    sentence="Red and blue are exchanged: the renders are in BGR.",
    advice="write the renders in RGB (OpenCV's imwrite takes BGR), and judge again.",
)
CAUSE = [CHANGES, TONE, CHANNELS]
