"""Some photos have less detail than the render of their view."""

from alignerf.causes import base

# Fine detail of a photo over its render's, against the median photo's; and the share of
# photos below it.
BLURRED_DETAIL, BLURRED_VIEWS = 0.6, 0.05

CAUSE = base.Cause(
    name="blurred",
    page="howto/fix.md#too-few-blurred-uneven-photos",
    order=(5, 8, 4),
    label="blurred photos",
    unit="%",
    scale=lambda e: 100,
    value=lambda e: e.blurred_fraction,
    limit=lambda e: BLURRED_VIEWS,
    called="some photos are {probably}blurred",
    sentence="{value:.0f} % of the photos are {probably}blurred: they are less "
    "sharp than their renders.",
    advice="leave out the blurred photos, see tables/views.csv.",
    advice_external="leave out the blurred photos, see tables/views.csv, and train "
    "again.",
)
