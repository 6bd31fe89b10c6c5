"""How far photos and renders are apart, and whether a run can tell.

`e` is a `base.Evidence`. Lengths are in pixels of the training size; those of
crops, `limit_px` and `shift_px` are in pixels of the photo. The page takes its limit
from here, too. How the thresholds were chosen: docs/evidence/verdict.md.
"""

import math

# Photos and renders of a scene in which nothing is wrong are 0.07 px apart. Under this
# length, in pixels of the training size, no capture is called misaligned.
ALIGNED_PX = 0.25
# In crops at the photos' own size, of training views and of test views: where both
# are longer, photos are misaligned. They were 0.3 to 0.5 and 0.7 to 1.0 px on three
# captures with right poses, 0.8 to 1.1 and 1.8 to 2.4 px on two with wrong ones: a
# model learns a part of a wrong pose, but not that of a view that it has not seen.
CROP_PX, CROP_TEST_PX = 0.5, 1.3
# Test views' flow over training views' there: beyond it a wrong pose may have been
# learnt as geometry. It was 1.3 to 3.1, and 7.6 to 12 where views lie far apart. How
# often each pixel of a crop has been seen at the least.
CROP_RATIO, CROP_EPOCHS = 5.0, 0.2
# "Aligned" is said where a shift of so much would have been seen, at the width that
# programs train at: they make photos smaller that are wider.
TOLD_PX, USUAL_WIDTH_PX = 1.0, 1600
# Views that no interval can be told from, and that no geometry can be learnt from.
FEW_TEST_VIEWS, FEW_TRAIN_VIEWS = 5, 12
# How often each training pixel has been seen.
FEW_EPOCHS = 0.5
# Of the matches' error, what wrong poses leave once they are corrected; and what any
# camera that is worth a correction does. Right ones gained up to 0.08, wrong ones 0.17.
LEFT, WORTH = 0.4, 0.85
# What the best cameras leave of it at the most, in px of a photo that is so wide: up to
# 0.5 whatever else is wrong, 0.35 to 1.6 where patches of photos move by 5 px. An
# adjustment that fails leaves more: so much of the photos has to move by itself.
SCATTER_PX, SCATTER_WIDTH_PX, SCATTER_MOVED = 0.52, 1000, 0.035
# Detail of another program's renders over their photos', in the second finest octave:
# of too short a training; and what leaves that open.
MIN_DETAIL, SOFT_DETAIL = 0.32, 0.5
# In the finest octave over the second: of smaller photos up to 0.41, of short
# trainings, which lack the second, too, from 0.61 on, and by wrong poses from 0.46 on.
# Of renders that lack the third it says nothing.
MIN_FINEST, MIN_FINEST_POSES, MIN_THIRD = 0.5, 0.43, 0.5


def told_px(overfit_px):
    """The shortest shift that a training can tell, in its pixels.

    overfit_px: the flow that the estimator invents where nothing is displaced; None or
    NaN where that is unknown.
    """
    unknown = overfit_px is None or math.isnan(overfit_px)
    return ALIGNED_PX if unknown else max(ALIGNED_PX, overfit_px)


def too_short(e):
    """Whether training was too short for its renders to tell anything of alignment.

    Of another program its renders tell, unless matches say that poses are far off:
    these blur renders, too.
    """
    if e.judged:
        return is_soft(e) and not explained_by_poses(e)
    return e.epochs < FEW_EPOCHS / 2


def detail(e):
    """Detail of renders over photos at two to four pixels, made as bright as these."""
    gain_ev = e.tone_gain_ev if math.isfinite(e.tone_gain_ev) else 0.0
    return e.octaves[1] * 2**gain_ev


def is_soft(e, least=MIN_DETAIL):
    """Whether renders lack more detail than those of smaller photos do."""
    return detail(e) < least and not is_smaller(e)


def finest(e):
    """Detail of renders over photos in the finest octave, over that in the second."""
    return e.octaves[0] / max(e.octaves[1], 1e-6)


def tells_size(e):
    """Whether renders tell the size of the photos that were trained on.

    They do not where they lack coarser octaves, too, where wrong poses may be what
    takes the finest, and where the trainer says it.
    """
    by_poses = poses_off(e) and finest(e) > MIN_FINEST_POSES
    return not (e.judged.trained_px or by_poses or e.octaves[2] < MIN_THIRD)


def is_smaller(e):
    """Whether another program's renders are of smaller photos: an octave is missing."""
    return tells_size(e) and finest(e) < MIN_FINEST


def corrected(m):
    """Whether an adjustment found something worth a correction: `base.Matches`."""
    return m.accepted and m.after_px < WORTH * m.before_px


def poses_off(e):
    """Whether matches say that the cameras in use are off."""
    m = e.matches
    told = bool(m and corrected(m) and not m.applied)
    return told and (takes_most(m) or not is_scattered(e))


def takes_most(m):
    """Whether an adjustment takes most of the matches' error away: `base.Matches`."""
    return m.after_px < LEFT * m.before_px


def scatter_px(e):
    """What the best cameras that were tried leave of the matches' error; or NaN."""
    if not (m := e.matches):
        return math.nan
    lenses = (one.after_px for one in (m.lens, m.left) if one)
    return min(m.before_px, m.after_px, *lenses)


def scatter_limit_px(e):
    """What right cameras may leave of it; more in a larger photo."""
    return SCATTER_PX * max(e.photo_width_px / SCATTER_WIDTH_PX, 1)


def is_scattered(e):
    """Whether points that photos share fit no cameras: they have moved."""
    return e.moved_fraction > SCATTER_MOVED and scatter_px(e) > scatter_limit_px(e)


def explained_by_poses(e):
    """Whether other poses take most of the matches' error away.

    A lens that was left out leaves them 0.5 of it, poses off by 3 px 0.07 to 0.2.
    """
    return poses_off(e) and takes_most(e.matches)


def is_sharp(e):
    """Whether flows tell of alignment: by crops where the training was too short."""
    return not too_short(e) or known_crops(e)


def misaligned(e):
    """Whether photos and renders of the training views are apart at all.

    Crops decide where they tell something; a shift of the whole photos of twice its
    limit counts beside them.
    """
    if by_crops(e):
        return True
    times = 2 if known_crops(e) else 1
    return flow_px(e) > times * told_px(e.overfit_px)


def flow_px(e):
    """The shift of training views, where they were rendered; else of test views."""
    return e.flow_train_px if math.isfinite(e.flow_train_px) else e.flow_test_px


def of_crops_say(e):
    """What crops say: `aligned`, `misaligned`, or why nothing; None without any."""
    w = e.crops
    if w is None:
        return None
    if not (math.isfinite(w.flow_px) and math.isfinite(w.flow_test_px)):
        return "unknown"
    if w.epochs < CROP_EPOCHS:
        return "short"
    if w.photos < FEW_TRAIN_VIEWS or w.test_photos < FEW_TEST_VIEWS:
        return "few"
    if w.flow_px > CROP_PX:
        return "misaligned" if w.flow_test_px > CROP_TEST_PX else "unconfirmed"
    is_sparse = w.flow_test_px > CROP_RATIO * max(w.flow_px, 0.05)
    return "sparse" if is_sparse else "aligned"


def by_crops(e):
    """Whether crops at the photos' own size are apart."""
    return of_crops_say(e) == "misaligned"


def known_crops(e):
    """Whether crops tell anything."""
    return of_crops_say(e) in ("aligned", "misaligned")


def limit_px(e):
    """The least shift that the run tells, in px of the photo."""
    return CROP_PX if known_crops(e) else e.photo_px * told_px(e.overfit_px)


def shift_px(e):
    """How far a photo and its render are apart, in px of the photo."""
    return e.crops.flow_px if by_crops(e) else e.photo_px * flow_px(e)


def tells(e):
    """Whether a shift that blurs a picture would have been seen.

    That is one pixel of the photo, or of one of 1600 px of width if it is wider.
    """
    if of_crops_say(e) == "unconfirmed" or not math.isfinite(flow_px(e)):
        return False
    wide = min(1.0, USUAL_WIDTH_PX / e.photo_width_px)
    return not limit_px(e) * wide > TOLD_PX


def views(e):
    """Photos to learn from; of renders that are judged, those of the larger split."""
    return max(e.train_views, e.test_views) if e.judged else e.train_views


def few_train(e):
    """Whether views are too few to learn from; of judged ones, to tell anything by."""
    return views(e) < FEW_TRAIN_VIEWS
