"""Brightness changes from photo to photo, or slowly over all of them."""

import math

from alignerf.causes import base, shift

# Standard deviation over views, of photos over their renders; and of photos over one
# another. A slow change is learnt as a colour that depends on the direction, so that
# no render shows it, and does less harm: a phone that exposes as it goes comes to 0.13.
EXPOSURE_EV, SHARED_EV = 0.06, 0.16


def shown(e):
    """(how much exposure changes in stops, its limit), by what shows it best.

    Depth of a training that was too short does not say which points photos share, nor
    does that of sparse points: one capture with right exposure had 0.17 by these.
    """
    told = [(e.exposure_ev, EXPOSURE_EV)]
    coarse = e.judged and e.judged.depth != "given"
    if math.isfinite(e.shared_ev) and not (coarse or shift.too_short(e)):
        told.append((e.shared_ev, SHARED_EV))
    return max(told, key=lambda one: one[0] / one[1])


CAUSE = base.Cause(
    name="exposure",
    order=(6, 9, 5),
    label="exposure",
    unit="stops",
    value=lambda e: shown(e)[0],
    limit=lambda e: shown(e)[1],
    called="exposure {probably}changes",
    sentence="Exposure {probably}changes between photos, by {value:.2f} stops "
    "(standard deviation).",
    advice="fix the exposure, or even it out before training.",
    advice_external="fix the exposure, even it out before training, or switch on your "
    "program's appearance model.",
)
