"""Brightness changes from photo to photo, or slowly over all of them; or all renders
of another program have another than their photos.
"""

import math

from alignerf.causes import base, shift

# Standard deviation over views, of photos over their renders; and of photos over one
# another. A slow change is learnt as a colour that depends on the direction, so that
# no render shows it, and does less harm: a phone that exposes as it goes comes to 0.13.
EXPOSURE_EV, SHARED_EV = 0.084, 0.16
# Of a curve common to all renders, in stops: at most 0.05 where nothing is wrong. Half
# a stop makes flows stumble.
TONE_EV, STRONG_EV = 0.1, 0.5


def shown(e):
    """(how much exposure changes in stops, its limit), by what shows it best.

    Depth of a training that was too short does not say which points photos share, nor
    does that of sparse points: one capture with right exposure had 0.17 by these.
    """
    told = [(e.exposure_ev, EXPOSURE_EV)]
    coarse = e.judged and e.judged.depth != "given"
    if math.isfinite(e.shared_ev) and not (coarse or shift.too_short(e)):
        told.append((e.shared_ev, SHARED_EV))
    known = [one for one in told if math.isfinite(one[0])]
    return max(known or told, key=lambda one: one[0] / one[1])


CHANGES = base.Cause(
    name="exposure",
    page="howto/fix.md#too-few-blurred-uneven-photos",
    order=(6, 9, 5),
    label="exposure",
    unit="stops",
    explains=("sparse", "motion"),
    explains_now=lambda e: e.exposure_ev > 2 * EXPOSURE_EV,
    spoils="brightness changes between photos",
    # What points share is blurred by wrong poses; what all renders show is not.
    stands=lambda e: e.exposure_ev > 2 * EXPOSURE_EV,
    value=lambda e: shown(e)[0],
    limit=lambda e: shown(e)[1],
    called="exposure {probably}changes",
    sentence="Exposure {probably}changes between photos, by {value:.2f} stops "
    "(standard deviation).",
    advice="lock the exposure, or even it out before training.",
    advice_external="lock the exposure, even it out before training, or enable your "
    "program's appearance model.",
)


def curve(e):
    """{what: stops} by which a curve common to all renders changes them."""
    stops = {
        "gain": abs(e.tone_gain_ev),
        "gamma": abs(e.tone_gamma - 1),
        "white balance": e.tone_white_ev,
    }
    return {what: ev for what, ev in stops.items() if math.isfinite(ev)}


def toned(e, probably):
    """What the common curve is."""
    side = "darker" if e.tone_gain_ev > 0 else "brighter"
    said = {
        "gain": f"{abs(e.tone_gain_ev):.2f} stops {side}",
        "gamma": f"a gamma of {e.tone_gamma:.2f}",
        "white balance": f"{e.tone_white_ev:.2f} stops between colour channels",
    }
    parts = [said[what] for what, ev in curve(e).items() if ev > TONE_EV]
    return f"All renders {probably}differ from their photos: {', '.join(parts)}."


def not_by_blur(e):
    """Whether more than a gamma is off: blurred renders have less contrast, too."""
    return max(e.tone_white_ev, abs(e.tone_gain_ev)) > TONE_EV


TONE = base.Cause(
    name="tone",
    order=(13, 5.1, 4.5),
    label="tone curve of the renders",
    unit="stops",
    value=lambda e: max(curve(e).values(), default=math.nan),
    limit=lambda e: TONE_EV,
    decide=lambda e: TONE.beyond(e) if e.judged else None,
    looked_for=lambda e: bool(e.judged),
    explains=("sparse", "motion", "floaters"),
    explains_now=lambda e: max(curve(e).values()) > STRONG_EV,
    spoils="renders have another tone curve",
    stands=not_by_blur,
    called="renders {probably}have another tone curve than their photos",
    sentence=toned,
    advice="",
    advice_external="write the renders in sRGB, as the photos are, and judge again: "
    "linear colors, or a gamma curve applied twice, shift all of them.",
)
CAUSE = [CHANGES, TONE]
