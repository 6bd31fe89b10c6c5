"""How alike renders of a splat and photos are: in fine detail, where the splat covers.

The background, exposure and tone decide nothing, and cameras may be somewhat off.
Measured as the mean of four views. Right ones, of OpenSplat on three captures: 0.49 to
0.60 after 1500 steps, 0.56 and more after 150; with cameras off by 40 of 1000 px since,
0.40; trained with cameras off by 20 of 1000 px, 0.32. Exposure, gamma and blur cost
0.02 at most. Made-up ones: 0.7 rendered on black where photos are on white, 0.5 with a
tenth of the Gaussians, 0.45 behind many floaters. Wrong ones: 0.16 at most of other
colours, places, or cameras in another order. Mirrored about the floor, which is then
right, they reach 0.27: they are tried below `SURE`. With the next photo's cameras they
reach 0.52: that this photo is nearer tells, `instead`.

Notation: photo [h, w, 3] uint8 of a render's size, about SMALL_PX; counts [h, w].
"""

import cv2
import numpy as np

from alignerf.metrics import pairs

# The longest side, and the likeness at least of a splat that shows its photos. Below
# the last, it may show them mirrored.
SMALL_PX, SHOWS, SURE = 160, 0.22, 0.35
# Another photo is nearer by more (of Fisher's z), as the median of up to 12 views: by
# 0.25 and more with cameras of the next photo, by -0.01 at most of right ones with
# cameras off by 40 of 1000 px, else by -0.07.
NEARER = 0.15
# Detail is what lies between two blurs, divided by its size round about: exposure and
# tone are gone. Noise, in 8-bit levels, is none. All in px of SMALL_PX.
FINE_PX, COARSE_PX, AROUND_PX, NOISE = 2.0, 6.0, 8.0, 2.0
# Renders of cameras that are off are moved so far at most.
APART_PX = 4
# A pixel is covered from this alpha on.
COVERED = 0.5
# Standard errors (of Fisher's z) that are taken off: few pixels are alike by chance,
# the more so when moved. Blurred as they are, so many px are one sample.
ERRORS, SAMPLE_PX = 2.0, 4 * np.pi * FINE_PX**2


def of(made, photos):
    """[n]: the likeness of a `rasterize.Render` to each of the photos, up to 1."""
    counts = (made.alpha > COVERED).astype(np.float32)
    if not counts.any():
        return np.zeros(len(photos))
    render = detail(to_bytes(made.colour), counts)
    found = []
    for photo in photos:
        padded = cv2.copyMakeBorder(
            detail(photo, counts), *(APART_PX,) * 4, cv2.BORDER_REFLECT
        )
        moved = cv2.matchTemplate(padded, render, cv2.TM_CCOEFF_NORMED, mask=counts)
        # Of a picture of one colour it is NaN or infinite.
        found.append(moved.max(where=np.abs(moved) < 1.001, initial=0.0))
    certain = np.arctanh(np.minimum(found, 1 - 1e-9, dtype=np.float64))
    return np.tanh(certain - ERRORS * np.sqrt(SAMPLE_PX / counts.sum()))


def detail(image, counts):
    """Fine detail [h, w] of the pixels that count, by these alone."""

    def blurred(values, sigma_px):
        total, share = (
            cv2.GaussianBlur(one, (0, 0), sigma_px) for one in (counts * values, counts)
        )
        return total / np.maximum(share, 1e-3)

    values = pairs.grey(image)
    fine = blurred(values, FINE_PX) - blurred(values, COARSE_PX)
    return fine / np.sqrt(blurred(fine**2, AROUND_PX) + NOISE**2)


def instead(made, name, photos):
    """(how much nearer than its own photo, which): what else a render shows best.

    photos: {view: photo}; name: its own.
    """
    turned = {
        f"its photo turned or mirrored ({how})": one
        for how, one in pairs.turnings(photos[name])
        if one.shape == photos[name].shape
    }
    others = turned | {view: one for view, one in photos.items() if view != name}
    (own, *found) = of(made, [photos[name], *others.values()])
    best = int(np.argmax(found))
    # One that is less alike than any right one is no better than its own.
    nearer = np.arctanh(found[best]) - np.arctanh(max(own, SHOWS))
    return float(nearer), [*others][best]


def to_bytes(colour):
    return np.round(np.clip(colour, 0, 1) * 255).astype(np.uint8)
