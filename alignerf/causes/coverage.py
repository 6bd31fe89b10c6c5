"""Photos are too few, too far apart, or in no model; floaters hang where none is."""

import math

from alignerf.causes import base, blur, exposure
from alignerf.causes.shared import misalignment

# Training views fit their renders, test views do not: geometry that photos do not fix.
# A gap in PSNR says so, a smaller one where photos see the same from farther aside than
# this, and a larger one where they do not, within these times. Where they are held out,
# blurred photos are matched worse as well.
GAP_DB, FAR_DEG, TIMES, BY_BLUR = 4.0, 20.0, (0.75, 2.0), 2
# Share of the photos that COLMAP has placed.
REGISTERED = 0.9
# Of the views, those of which a floater hides a part; and as many at the least.
FLOATER_VIEWS, MIN_VIEWS = 0.063, 2


def find_sparse(e):
    """By how much held-out photos are matched worse than those learnt from, in dB."""
    gap_db = e.psnr_train_db - e.psnr_test_db
    limit_db = GAP_DB
    if not math.isnan(e.apart_deg):
        limit_db *= min(max(FAR_DEG / max(e.apart_deg, 1e-9), TIMES[0]), TIMES[1])
    least_db = limit_db * (BY_BLUR if blur.CAUSE.find(e).sure is not None else 1)
    # Held-out views may have the right shape. A splat knows its photos by heart: the
    # gap was 7.8 dB where held-out photos were 0.18 px from their renders.
    fits = e.judged and e.flow_test_px < misalignment.told_px(e.overfit_px)
    # Brightness that changes is learnt as what depends on the direction.
    learnt = exposure.find_changes(e).sure is not None and e.apart_deg <= FAR_DEG
    return base.beyond(
        gap_db,
        limit_db,
        where=gap_db > least_db and not learnt and (not fits or e.apart_deg > FAR_DEG),
        said=f"training photos reach {e.psnr_train_db:.1f} dB, held-out ones "
        f"{e.psnr_test_db:.1f}",
    )


def is_sparse(e):
    """Training views fit and test views do not, whatever else may explain that."""
    return find_sparse(e).sure is not None


def find_few_views(e):
    """Photos to learn or to judge from."""
    least = misalignment.FEW_TRAIN_VIEWS, misalignment.FEW_TEST_VIEWS
    views, few = misalignment.views(e), misalignment.few_train(e)
    few_test = e.test_views < least[1] and not e.judged
    shown = (e.test_views, least[1]) if few_test and not few else (views, least[0])
    what = "renders" if e.judged else "photos to learn from"
    short = [(f"{views} {what}", least[0])] * few
    short += [(f"{e.test_views} held-out photos", least[1])] * few_test
    counts, needed = (" and ".join(str(one[i]) for one in short) for i in (0, 1))
    return base.Finding(
        *shown,
        True if few or few_test else None,
        more_is_better=True,
        said=f"{counts} are few: at least {needed} are needed",
        explains=few,
        measured=f"{e.train_views} and {e.test_views} held out",
    )


def find_unregistered(e):
    """Photos that are in no model, or in another one, in percent."""
    if e.poses_given or e.judged:
        return None
    share = e.registered / max(e.total, 1)
    return base.Finding(
        100 * (1 - share),
        100 * (1 - REGISTERED),
        True if share < REGISTERED else None,
        said=f"{e.registered} of {e.total} photos",
        measured=f"{e.registered} of {e.total}",
    )


def find_floaters(e):
    """Views that a floater hides a part of, in percent; renders have to have depth."""
    if not (e.judged and e.judged.depth == "given"):
        return None
    share = e.hidden_views / max(e.train_views + e.test_views, 1)
    return base.beyond(
        100 * share,
        100 * FLOATER_VIEWS,
        where=e.hidden_views >= MIN_VIEWS,
        said=f"{e.hidden_views:.0f} views",
        measured=f"in {base.number(e.hidden_views)} views",
    )


SPARSE = base.Cause(
    name="sparse",
    label="gap of held-out photos",
    unit="dB",
    find=find_sparse,
    explains=("motion",),
    spoils="photos do not determine the geometry",
    called="photos are {probably}too few or too far apart",
    sentence="Photos are {probably}too few or too far apart: {said}.",
    advice="take more photos between those you have. Warping would not help.",
    page="howto/fix.md#too-few-blurred-uneven-photos",
)
FEW_VIEWS = base.Cause(
    name="few_views",
    label="number of photos",
    unit="photos",
    find=find_few_views,
    explains=("sparse",),
    spoils="photos are few",
    called="photos are few",
    sentence="{said}.",
    advice="take more photos: 20 or more that overlap.",
    page="howto/fix.md#too-few-blurred-uneven-photos",
)
UNREGISTERED = base.Cause(
    name="unregistered",
    label="photos registered by COLMAP",
    unit="% left out",
    find=find_unregistered,
    called="photos are left out",
    sentence="COLMAP registered {said}: the others do not "
    "overlap with them, or show another place.",
    advice="take photos between those that are left out and the others.",
    page="howto/fix.md#too-few-blurred-uneven-photos",
)
FLOATERS = base.Cause(
    name="floaters",
    label="floaters",
    unit="% of the views",
    find=find_floaters,
    called="floaters {probably}hide parts of views",
    sentence="Floaters {probably}hide parts of {said}{photos}: they show "
    "something close to the camera that is not in the photo.",
    advice="take more photos where floaters hang, or prune what is near the "
    "cameras before exporting the splat.",
)
CAUSE = [SPARSE, FEW_VIEWS, UNREGISTERED, FLOATERS]
