"""One tone curve between all renders and their photos: gain, gamma, white balance.

A program that writes linear colours, or another gamma, changes all renders alike; what
changes from photo to photo is exposure. Levels are compared in small pictures, which
misalignment does not reach.
"""

import math
from typing import NamedTuple

import cv2
import numpy as np

SMALL_PX = 24
# Of 8 bits: beyond, a level is clipped or noise.
DARKEST, BRIGHTEST = 8.0, 247.0
# A view says nothing by fewer levels.
MIN_LEVELS = 20
# Standard deviation of levels that a curve can be told from, in stops.
MIN_CONTRAST_EV = 0.1
# Levels of two pictures differ by so much anyhow.
CLEAR_EV = 0.005


class Levels(NamedTuple):
    """Levels [n, 3] of a photo and its render, in stops (log2 of 8-bit values)."""

    photo: np.ndarray
    render: np.ndarray


class Tone(NamedTuple):
    """photo = middle * 2 ** gain_ev * (render / middle) ** gamma, in 8-bit values.

    middle: the renders' median level. gamma: NaN where they have no contrast. white_ev:
    stops between the channel whose gain is highest and the one whose gain is lowest.
    even_ev [n]: what is left of each view, its own exposure. exchanged: what is left
    where the renders' red and blue are exchanged, by one gain of a view, over what is
    left where they are not, by one of each channel: below 1 they are BGR.
    """

    gain_ev: float
    gamma: float
    white_ev: float
    even_ev: np.ndarray
    exchanged: float = math.nan


def levels_of(photo, render, counts):
    """`Levels` of a pair [h, w, 3] uint8; counts [h, w]: the pixels that count."""
    height, width = photo.shape[:2]
    scale = SMALL_PX / max(height, width)
    size = max(round(width * scale), 1), max(round(height * scale), 1)
    share = resized(counts.astype(np.float32), size)
    small = [
        resized(one * counts[..., None].astype(np.float32), size)
        for one in (photo, render)
    ]
    small = [one / np.maximum(share, 1e-6)[..., None] for one in small]
    usable = share > 0.5
    for one in small:
        usable &= ((one >= DARKEST) & (one <= BRIGHTEST)).all(axis=-1)
    return Levels(*(np.log2(one[usable]) for one in small))


def resized(image, size):
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def of_views(views) -> Tone:
    """The `Tone` of all views' `Levels`."""
    known = [len(view.photo) >= MIN_LEVELS for view in views]
    even_ev = np.full(len(views), np.nan)
    some = [view for view, one in zip(views, known, strict=True) if one]
    if not some:
        return Tone(np.nan, np.nan, np.nan, even_ev)
    photo, render = (
        np.concatenate([level - np.median(level, axis=0) for level in levels])
        for levels in zip(*some, strict=True)
    )
    gamma, power = slope(render.ravel(), photo.ravel()), 1.0
    if math.isfinite(gamma):
        power = gamma
    middle = np.median(np.concatenate([view.render for view in some]))
    gains = np.array(
        [
            np.median(view.photo - middle - power * (view.render - middle), axis=0)
            for view in some
        ]
    )
    each = np.median(gains, axis=0)
    even_ev[known] = gains.mean(axis=1) - each.mean()
    white_ev, left = float(np.ptp(each)), exchanged(some, power)
    return Tone(float(each.mean()), gamma, white_ev, even_ev, left)


def exchanged(views, power):
    """What one gain leaves of renders in BGR, over what three leave of them in RGB."""
    left = np.full(2, 1e-9)
    for view in views:
        straight = view.photo - power * view.render
        other = view.photo - power * view.render[:, ::-1]
        other, straight = other - np.median(other), straight - np.median(straight, 0)
        left += [np.abs(one).sum() + CLEAR_EV * one.size for one in (other, straight)]
    return float(left[0] / left[1])


def slope(x, y):
    """Robust slope of y over x, both with errors: by what neither is far off.

    NaN where one of them hardly varies.
    """
    if min(np.std(x), np.std(y)) < MIN_CONTRAST_EV:
        return math.nan
    found = float(np.std(y) / max(np.std(x), 1e-6))
    for _ in range(10):
        error = np.abs(y - found * x)
        near = error <= 2.5 * max(np.median(error), 1e-3)
        found = float(np.std(y[near]) / max(np.std(x[near]), 1e-6))
    return found
