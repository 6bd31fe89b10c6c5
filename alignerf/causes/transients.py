"""Things come and go between photos: what one shows and others of the place do not."""

from alignerf.causes import base
from alignerf.causes.shared import misalignment

# Of what photos show: 0.001 where nothing is there, 0.006 where one photo of 25 has a
# car, 0.025 where every second one has something on a twentieth of it. Poses that are
# off by 6 px double it.
FRACTION, ANYWAY = 0.005, 3


def find(e):
    """The share in percent; poses that are off make some of it."""
    percent, limit = 100 * e.transient_fraction, 100 * FRACTION
    limit *= ANYWAY if misalignment.poses_off(e) else 1
    return base.beyond(percent, limit, stands=True, explains=percent > 2 * limit)


CAUSE = base.Cause(
    name="transients",
    label="things that come and go",
    unit="%",
    find=find,
    explains=(
        *("sparse", "motion", "floaters", "blurred", "exposure", "tone"),
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
