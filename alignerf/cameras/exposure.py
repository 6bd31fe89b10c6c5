"""How bright photos are against one another, by the points that they share.

A model learns a slow change of exposure as a colour that depends on the direction, and
its renders then follow each photo. Two photos of the same points do not. Depth from
renders says which pixels show the same point.
"""

from typing import NamedTuple

import cv2
import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from alignerf.scenes import cameras

# Photos are compared with a longer side of so much, and of each so many pixels at most,
# on a regular grid, are looked for in others.
LONGEST_PX, MAX_PIXELS = 400, 1500
# Each photo is compared with so many that look alike, and with so many drawn.
NEAREST, DRAWN = 6, 10
# A pair says nothing that shares less of its first photo's pixels: a small part may be
# a thing that shines. Nor does one whose pixels disagree by more (half of them, stops).
MIN_FRACTION, MAX_SPREAD_EV = 0.25, 0.4
# And so many pixels at least.
MIN_PIXELS = 80
# A point is the same one where the other photo's depth agrees, as a share of it.
DEPTH_AGREES = 0.05
# Of 8 bits: beyond, a pixel is clipped or noise.
DARKEST, BRIGHTEST = 8.0, 247.0
SIGMA_PX = 1.5
# Rounds of reweighting, and the pair's error in stops beyond which it counts less.
ROUNDS, CLEAR_EV = 10, 0.05


class View(NamedTuple):
    """A photo [h, w, 3] uint8, depth [h, w] along the axis, and its camera.

    Depth that is not positive and finite is unknown. counts [h, w]: where the photo
    counts, or None.
    """

    photo: np.ndarray
    depth: np.ndarray
    pixtocam: np.ndarray
    camtoworld: np.ndarray
    counts: np.ndarray | None = None


class Sampled(NamedTuple):
    """A view made small, and the points of the world that some of its pixels show.

    points [n, 3], seen [n]: their levels of 8 bits. levels, depth [h, w]: NaN where a
    pixel is clipped, or its depth unknown.
    """

    points: np.ndarray
    seen: np.ndarray
    levels: np.ndarray
    depth: np.ndarray
    pixtocam: np.ndarray
    camtoworld: np.ndarray


def sampled(view: View) -> Sampled:
    """The parts of a view that are compared with other views."""
    # Of each k x k pixels the middle one: a mean of two depths is that of nothing.
    k = -(-max(view.depth.shape) // LONGEST_PX)
    chosen, pixtocam = every_kth(k, view.pixtocam)
    depth = view.depth[chosen].astype(np.float64)
    grey = cv2.cvtColor(np.ascontiguousarray(view.photo), cv2.COLOR_RGB2GRAY)
    levels = cv2.GaussianBlur(grey.astype(np.float32), (0, 0), SIGMA_PX * k)[chosen]
    usable = (levels >= DARKEST) & (levels <= BRIGHTEST)
    usable &= np.isfinite(depth) & (depth > 0)
    if view.counts is not None:
        usable &= view.counts[chosen]
    levels, depth = (np.where(usable, image, np.nan) for image in (levels, depth))
    stride = int(np.ceil(np.sqrt(usable.size / MAX_PIXELS)))
    y, x = (stride * axis for axis in np.nonzero(usable[::stride, ::stride]))
    rays = cameras.pixels_to_rays(x, y, pixtocam, view.camtoworld)
    points = rays.origins + depth[y, x][:, None] * rays.directions
    return Sampled(points, levels[y, x], levels, depth, pixtocam, view.camtoworld)


def every_kth(k, pixtocam):
    """(what takes every k-th pixel of an image [h, w], the camera of these)."""
    # Pixel i of the small image is pixel k i + k // 2 of the whole.
    shift = k // 2 + 0.5 - 0.5 * k
    of_small = np.array([[k, 0, shift], [0, k, shift], [0, 0, 1.0]])
    return (slice(k // 2, None, k),) * 2, pixtocam @ of_small


def landed(points, view: Sampled):
    """Where points [n, 3] are in a view: (inside [n], the pixels (y, x) of those, and
    their depth).
    """
    pixel, depth = cameras.project(points, view.pixtocam, view.camtoworld)
    h, w = view.depth.shape
    inside = (depth > 0) & (pixel >= 0).all(axis=-1) & (pixel < (w, h)).all(axis=-1)
    x, y = np.floor(pixel[inside]).astype(int).T
    return inside, (y, x), depth[inside]


def ratio(first: Sampled, second: Sampled):
    """(stops by which the second photo is brighter, pixels that say so)."""
    inside, at, depth = landed(first.points, second)
    levels = second.levels[at]
    same = np.abs(second.depth[at] - depth) < DEPTH_AGREES * depth
    count = int(same.sum())
    if count < max(MIN_PIXELS, MIN_FRACTION * len(first.seen)):
        return 0.0, 0
    stops = np.log2(levels[same] / first.seen[inside][same])
    low, middle, high = np.percentile(stops, [25, 50, 75])
    return (float(middle), count) if high - low <= MAX_SPREAD_EV else (0.0, 0)


def stops(views):
    """Stops [n] by which each photo is brighter than the median one.

    views: `Sampled`s. NaN of a photo that shares too little with the others. Photos in
    groups that share too little with one another have each the median of their group.
    """
    pairs = [
        (i, j, *ratio(views[i], views[j]))
        for i, others in enumerate(compared(views))
        for j in others
    ]
    pairs = [pair for pair in pairs if pair[3]]
    return solved(len(views), pairs)


def compared(views):
    """Of each view, the indices of those that it is compared with."""
    rng, chosen = np.random.default_rng(0), []
    for i, near in enumerate(nearest(views, NEAREST)):
        rest = np.setdiff1d(np.arange(len(views)), [i, *near])
        drawn = rng.choice(rest, min(DRAWN, len(rest)), replace=False)
        chosen.append([*near.tolist(), *drawn.tolist()])
    return chosen


def nearest(views, most):
    """Of each view, the indices of at most so many that look from near by, alike."""
    if not views:
        return
    centres = np.array([view.camtoworld[:, 3] for view in views])
    axes = np.array([view.camtoworld[:, 2] for view in views])
    size = max(np.ptp(centres, axis=0).max(), 1e-12)
    for i in range(len(views)):
        far = np.linalg.norm(centres - centres[i], axis=-1) / size
        far += 1 - axes @ axes[i]
        far[i] = np.inf
        yield np.argsort(far)[: min(most, len(views) - 1)]


def solved(count, pairs):
    """Stops [count] that fit pairs (i, j, stops of j over i, pixels) best, robustly."""
    found = np.full(count, np.nan)
    if not pairs:
        return found
    first, second = np.array([pair[:2] for pair in pairs]).T
    seen = np.array([pair[2] for pair in pairs])
    weight, values = np.ones(len(pairs)), np.zeros(count)
    for _ in range(ROUNDS):
        normal, right = np.zeros((count, count)), np.zeros(count)
        for one, sign in ((first, -1), (second, 1)):
            np.add.at(normal, (one, one), weight)
            np.add.at(right, one, sign * weight * seen)
        np.add.at(normal, (first, second), -weight)
        np.add.at(normal, (second, first), -weight)
        # What a photo without a pair is, nothing says: the least of all solutions.
        values = np.linalg.lstsq(normal, right, rcond=1e-9)[0]
        error = np.abs(values[second] - values[first] - seen)
        weight = 1 / np.maximum(error, CLEAR_EV)
    links = sparse.coo_matrix((np.ones(len(pairs)), (first, second)), (count, count))
    _, group = csgraph.connected_components(links, directed=False)
    for number in set(group[first]):
        own = group == number
        found[own] = values[own] - np.median(values[own])
    return found
