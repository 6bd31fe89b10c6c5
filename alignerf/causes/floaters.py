"""Something hangs before the cameras: floaters, which held-out views show."""

from alignerf.causes import base

# Of the views, those of which a floater hides a part; and as many at the least.
FLOATER_VIEWS, MIN_VIEWS = 0.04, 2


def share(e):
    """The fraction of the views that a floater hides a part of."""
    return e.hidden_views / max(e.train_views + e.test_views, 1)


CAUSE = base.Cause(
    name="floaters",
    order=(17, 8.5, 5.5),
    label="floaters",
    unit="% of the views",
    scale=lambda e: 100,
    value=share,
    limit=lambda e: FLOATER_VIEWS,
    looked_for=lambda e: bool(e.judged and e.judged.depth == "given"),
    decide=lambda e: (
        CAUSE.beyond(e) if CAUSE.looked_for(e) and e.hidden_views >= MIN_VIEWS else None
    ),
    called="floaters {probably}hide parts of views",
    sentence="Floaters {probably}hide parts of {e.hidden_views} views: something is "
    "rendered close to the camera that the photo does not show.",
    advice="",
    advice_external="take more photos where floaters hang, or prune what is near the "
    "cameras before exporting the splat.",
)
