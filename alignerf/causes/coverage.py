"""Photos are too few, too far apart, or in no model; floaters hang where none is."""

from alignerf.causes import base, shift

# Training views fit their renders, test views do not: geometry that photos do not fix.
# A gap in PSNR says so alone, a smaller one beside flows of this ratio.
GAP_DB, SMALL_GAP_DB, TEST_OVER_TRAIN = 4.0, 2.5, 2.5
# Share of the photos that COLMAP has placed.
REGISTERED = 0.9


def gap_db(e):
    """By how much held-out photos are matched worse than those learnt from."""
    return e.psnr_train_db - e.psnr_test_db


def sparse(e):
    """Training views fit and test views do not."""
    if e.judged and e.flow_test_px < shift.told_px(e.overfit_px):
        # Held-out views have the right shape. A splat knows its photos by heart: the
        # gap was 7.8 dB where held-out photos were 0.18 px from their renders.
        return None
    gap, ratio = gap_db(e), e.flow_test_px / max(e.flow_train_px, 0.05)
    by_flow = ratio > TEST_OVER_TRAIN and gap > SMALL_GAP_DB
    if not (gap > GAP_DB or by_flow):
        return None
    return gap, ratio > TEST_OVER_TRAIN and gap > GAP_DB


SPARSE = base.Cause(
    name="sparse",
    page="howto/fix.md#too-few-blurred-uneven-photos",
    order=(7, 4, 8),
    label="gap of held-out photos",
    unit="dB",
    value=gap_db,
    limit=lambda e: GAP_DB,
    decide=sparse,
    explains=("motion",),
    spoils="photos do not determine the geometry",
    called="photos are {probably}too few or too far apart",
    sentence="Photos are {probably}too few or too far apart: training photos reach "
    "{e.psnr_train_db:.1f} dB, held-out ones {e.psnr_test_db:.1f}.",
    advice="take more photos between those you have. Warping would not help.",
    advice_external="take more photos between those you have. Warping would not help.",
)


def few_views(e):
    """Too few photos to learn or to judge from."""
    few = shift.few_train(e) or few_held_out(e)
    return (e.train_views + e.test_views, True) if few else None


def few_held_out(e):
    """Whether it is the held-out photos that are too few."""
    few = e.test_views < shift.FEW_TEST_VIEWS and not e.judged
    return few and not shift.few_train(e)


def counted(e, probably):
    """A sentence on how many photos there are."""
    if e.judged:
        return (
            f"{shift.views(e)} renders are few: {shift.FEW_TRAIN_VIEWS} is the minimum."
        )
    return (
        f"{e.train_views} training and {e.test_views} held-out photos are few: "
        f"{shift.FEW_TRAIN_VIEWS} and {shift.FEW_TEST_VIEWS} are the minimum."
    )


FEW_VIEWS = base.Cause(
    name="few_views",
    page="howto/fix.md#too-few-blurred-uneven-photos",
    order=(8, 2, 10),
    label="number of photos",
    unit="photos",
    value=lambda e: e.test_views if few_held_out(e) else shift.views(e),
    limit=lambda e: shift.FEW_TEST_VIEWS if few_held_out(e) else shift.FEW_TRAIN_VIEWS,
    says=lambda e: f"{e.train_views} and {e.test_views} held out",
    more_is_better=True,
    decide=few_views,
    called="photos are few",
    sentence=counted,
    advice="take more photos: 20 or more that overlap.",
    advice_external="take more photos: 20 or more that overlap.",
)


def unregistered(e):
    """Photos that are in no model, or in another one."""
    share = e.registered / max(e.total, 1)
    return (share, True) if share < REGISTERED else None


UNREGISTERED = base.Cause(
    name="unregistered",
    page="howto/fix.md#too-few-blurred-uneven-photos",
    order=(9, 3, 9),
    label="photos registered by COLMAP",
    unit="% left out",
    scale=lambda e: 100,
    value=lambda e: 1 - e.registered / max(e.total, 1),
    limit=lambda e: 1 - REGISTERED,
    decide=unregistered,
    looked_for=lambda e: not (e.poses_given or e.judged),
    says=lambda e: f"{e.registered} of {e.total}",
    called="photos are left out",
    sentence="COLMAP registered {e.registered} of {e.total} photos: the others do not "
    "overlap with them, or show another place.",
    advice="take photos between those that are left out and the others.",
)
# Of the views, those of which a floater hides a part; and as many at the least.
FLOATER_VIEWS, MIN_VIEWS = 0.04, 2


def hidden(e):
    """The fraction of the views that a floater hides a part of."""
    return e.hidden_views / max(e.train_views + e.test_views, 1)


FLOATERS = base.Cause(
    name="floaters",
    order=(17, 8.5, 5.5),
    label="floaters",
    unit="% of the views",
    scale=lambda e: 100,
    value=hidden,
    limit=lambda e: FLOATER_VIEWS,
    looked_for=lambda e: bool(e.judged and e.judged.depth == "given"),
    decide=lambda e: (
        FLOATERS.beyond(e)
        if FLOATERS.looked_for(e) and e.hidden_views >= MIN_VIEWS
        else None
    ),
    says=lambda e: f"in {base.number(e.hidden_views)} views",
    called="floaters {probably}hide parts of views",
    sentence="Floaters {probably}hide parts of {e.hidden_views:.0f} views: they show "
    "something close to the camera that is not in the photo.",
    advice="",
    advice_external="take more photos where floaters hang, or prune what is near the "
    "cameras before exporting the splat.",
)
CAUSE = [SPARSE, FEW_VIEWS, UNREGISTERED, FLOATERS]
