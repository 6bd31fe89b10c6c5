"""Things come and go between photos: what one shows and others of the place do not."""

from alignerf.causes import base, exposure
from alignerf.causes.shared import misalignment

# Of what photos show: 0 to 0.001 where nothing is there, 0.002 to 0.004 where depth is
# poor, 0.004 to 0.02 where something is on a twentieth of each photo, 0.005 where one
# photo of 25 has a car. From where it is sure. Poses that are off may double it, and so
# may exposure that makes flows stumble.
FRACTION, SURE_FRACTION, BY_POSES, BY_EXPOSURE = 0.0035, 0.006, 2, 2


def find(e):
    """The share in percent; poses that are off make some of it.

    From few photos depth is a guess, which moves photos to wrong places.
    """
    times = BY_EXPOSURE if exposure.disturbs(e) else 1
    times = BY_POSES if misalignment.poses_off(e) else times
    sure = e.transient_fraction > times * SURE_FRACTION
    found = base.beyond(100 * e.transient_fraction, 100 * times * FRACTION)
    few = misalignment.few_train(e)
    told = None if few or found.sure is None else sure
    return found._replace(sure=told, explains=sure, detectable=not few)


CAUSE = base.Cause(
    name="transients",
    label="things that come and go",
    unit="%",
    find=find,
    explains=(
        *("sparse", "motion", "floaters", "blurred", "exposure"),
        *("lens_shift", "lens_distortion"),
    ),
    spoils="things come and go between photos",
    called="things {probably}come and go",
    sentence="Things {probably}come and go: {value:.1f} % of what photos show is not "
    "there in others of the same place{photos}.",
    advice="leave those photos out, or mask what comes and goes (`masks`).",
    advice_external="mask what comes and goes (`{export}` writes masks), leave those "
    "photos out, or use a trainer that is robust to it.",
    page="howto/fix.md#something-moved",
)
