"""Each photo against the render of its view: what stands out, and why.

Notation: photo and render [h, w, 3] uint8; flow_px [h, w, 2] from render to photo,
`valid` [h, w] where it holds.
"""

from typing import NamedTuple

import cv2
import numpy as np

from alignerf.metrics import image as image_metrics

# A view stands out where it is so many median deviations from the views' median.
STANDS_OUT = 5.0
# In a split of fewer views chance makes a spread small.
FEW = 12
MAX_DB = 100.0
# A flow finds no place in a window whose 8-bit levels deviate by less: a sky has 0.8.
WINDOW_PX, FLAT_LEVELS = 15, 2.0


class View(NamedTuple):
    """One photo. Lengths are medians over its valid pixels, in px of the training."""

    view: str
    split: str
    psnr_db: float
    # The same with the render made as bright as the photo.
    cc_psnr_db: float
    flow_px: float
    # Of the flow, what a moved camera explains, and the rest.
    camera_px: float
    remainder_px: float
    # Share of the pixels that do not move with the camera, and visibly.
    moved_fraction: float
    # Fine detail of the photo over that of the render, in the direction in which it is
    # least: a blurred photo has less.
    sharpness_ratio: float
    # How much brighter the photo is than the render, in stops (EV).
    exposure_ev: float
    # Blur that makes the photo like the render.
    blur_sigma_px: float
    # Share of what it shows that other photos of the same place, or its render, lack.
    transient_fraction: float = np.nan
    # Why it stands out among the views; empty where it does not.
    stands_out: str = ""


COLUMNS = View._fields


def measured(photo, render, valid, counts=None):
    """The fields of `View` by a photo and the render of its view, without their flow.

    counts [h, w]: where the photo counts; everywhere, where None.
    """
    everywhere = np.ones(photo.shape[:2], bool) if counts is None else counts
    photo = np.where(everywhere[..., None], photo, render)
    chosen = valid if valid.any() else everywhere
    stops = exposure_ev(photo, render, chosen)
    even = np.clip(np.round(render * 2.0**stops), 0, 255).astype(np.uint8)
    return {
        "psnr_db": capped_psnr_db(photo, render, everywhere),
        "cc_psnr_db": capped_psnr_db(photo, even, everywhere),
        "sharpness_ratio": image_metrics.least_detail(photo, render),
        "exposure_ev": stops,
    }


def textured(photo):
    """Mask [h, w]: the photo has levels that differ nearby."""
    grey = photo.mean(axis=-1, dtype=np.float32)
    mean, square = (cv2.blur(one, (WINDOW_PX,) * 2) for one in (grey, grey**2))
    return square - mean**2 > FLAT_LEVELS**2


def capped_psnr_db(photo, render, everywhere):
    """PSNR in dB, of identical images MAX_DB: means stay finite."""
    return min(float(image_metrics.psnr_db(photo, render, everywhere)), MAX_DB)


def exposure_ev(photo, render, valid):
    """Stops by which the photo is brighter, of means over pixels that are not clipped.

    Of 8-bit values as they are: a camera's curve makes of a stop of light about half
    a stop here, so that this is a lower bound.
    """
    usable = valid & (photo.max(axis=-1) < 250) & (render.max(axis=-1) < 250)
    if not usable.any():
        usable = valid
    levels = [float(image[usable].mean()) for image in (photo, render)]
    return float(np.log2(max(levels[0], 0.5) / max(levels[1], 0.5)))


def named(views):
    """The views, each with why it stands out among those of its split.

    A view of a small split has to stand out among all, too.
    """
    rows = [
        one._replace(stands_out=TRANSIENT * (one.transient_fraction > LARGE))
        for one in views
    ]
    far_off = [far(rows, key, sign) for key, sign, _ in REASONS]
    for split in ("train", "test"):
        places = [i for i, view in enumerate(rows) if view.split == split]
        if len(places) < 5:
            continue
        for (key, sign, what), of_all in zip(REASONS, far_off, strict=True):
            own = far([rows[i] for i in places], key, sign)
            if len(places) < FEW:
                own = np.minimum(own, of_all[places])
            for i in np.array(places)[own > STANDS_OUT]:
                why = "; ".join(filter(None, [rows[i].stands_out, what]))
                rows[i] = rows[i]._replace(stands_out=why)
    return rows


def odd(views):
    """The views that stand out, first those that are the farthest from all others.

    Before them those whose reason is none of a number.
    """
    rows = list(views)
    farthest = np.full(len(rows), -np.inf)
    for key, sign, what in REASONS:
        is_why = [what in one.stands_out for one in rows]
        own = np.where(is_why, far(rows, key, sign), -np.inf)
        farthest = np.maximum(farthest, own)
    order = np.argsort(np.where(np.isfinite(farthest), -farthest, -np.inf))
    return [rows[i] for i in order if rows[i].stands_out]


def far(views, key, sign):
    """[n] how far each view is out, by a number and on one side of the others'."""
    values = np.array([getattr(one, key) for one in views], float)
    return sign * deviations(values, MIN_SPREADS.get(key))


# A view stands out, whatever the others are, where it has so much that comes and goes.
LARGE, TRANSIENT = 0.02, "shows what other photos do not"
# What makes a view stand out, and in which direction.
REASONS = (
    ("psnr_db", -1, "much farther from its render than the others"),
    ("flow_px", 1, "misaligned with its render"),
    ("camera_px", 1, "its camera is farther off than the others"),
    ("moved_fraction", 1, "much of it moved"),
    ("sharpness_ratio", -1, "blurred"),
    ("exposure_ev", 1, "brighter than the others"),
    ("exposure_ev", -1, "darker than the others"),
)
# No spread is known better than this share of the median, or this number.
MIN_SPREAD = 0.1, 0.02
# A tenth of a PSNR would be 3 dB: somebody in six photos, 9 dB off, did not stand out.
MIN_SPREADS = {"psnr_db": 0.5}


def deviations(values, least=None):
    """How far each value [n] is from the median, in robust standard deviations.

    least: one of them, in place of MIN_SPREAD.
    """
    known = values[np.isfinite(values)]
    if not len(known):
        return np.zeros(len(values))
    middle = np.median(known)
    spread = 1.4826 * np.median(np.abs(known - middle))
    least = least or max(MIN_SPREAD[0] * abs(middle), MIN_SPREAD[1])
    # A view without a number does not stand out by it.
    distances = (values - middle) / max(spread, least)
    return np.where(np.isfinite(values), distances, 0.0)
