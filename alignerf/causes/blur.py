"""Some photos have less detail than the render of their view."""

from alignerf.causes import base

# Fine detail of a photo over its render's, against the median photo's, which is 0.77
# and more of photos as they are; and the share of photos below it.
BLURRED_DETAIL, BLURRED_VIEWS = 0.7, 0.05

CAUSE = base.Cause(
    name="blurred",
    label="blurred photos",
    unit="%",
    find=lambda e: base.beyond(100 * e.blurred_fraction, 100 * BLURRED_VIEWS),
    called="some photos are {probably}blurred",
    sentence="{value:.0f} % of the photos are {probably}blurred{photos}: they are "
    "less sharp than their renders.",
    advice="leave out the blurred photos.",
    advice_external="leave out the blurred photos, and train again.",
    page="howto/fix.md#too-few-blurred-uneven-photos",
)
