"""What one photo shows and others of the same place do not: somebody who walks through.

A flow says nothing of what is there or not. Photos of other views, moved into a view by
the depth of their own renders, tell what the place looks like without it. So does the
view's own render, which averages over photos: of what only one of them shows it has
learnt little. Each errs elsewhere, so that what both tell counts: `fraction`.
"""

from typing import NamedTuple

import cv2
import numpy as np

from alignerf.cameras import exposure
from alignerf.io import archives
from alignerf.scenes import cameras

# Photos are compared with a longer side of so much.
LONGEST_PX = 160
# With so many neighbours each; fewer than so many agree on nothing.
NEIGHBOURS, MIN_AGREE = 20, 3
# Levels of 8 bits that a photo is apart by from what others agree on: at least; in
# times of what they are apart from one another there; and in times of what three
# quarters of it stay below, which bad depth makes more. Of what is told, and inside.
WEAK, STRONG = (15.0, 2.0, 1.5), (25.0, 3.0, 2.5)
# Levels that no shadow leaves, which makes all channels darker alike.
SHADE = 13.5
# Of what a part is apart from others by: a render that is nearer to the photo shows the
# same, so that its depth is wrong, as of a fence or of the sky behind an edge.
UNLIKE_RENDER = 0.4
# Of what a part is apart from its render by: others that are nearer show the same, and
# the render has not learnt it. Others have to know so much of the part.
UNLIKE_OTHERS, MIN_SEEN = 0.5, 0.3
# Of the longer side: what is finer than this is not looked for.
SIGMA_FRACTION = 0.012
# Of the pixels that are known of a view: a smaller part is none.
MIN_PART = 0.006
# Of a view: what has to be known of it; of that: a larger part is no thing any more.
MIN_KNOWN, MAX_PART = 0.1, 0.5
# A surface hides what is farther away by so much.
BEHIND = 1.05
# As bright as so many pixels say.
MIN_PIXELS = 100


class View(NamedTuple):
    """A view made small: blurred photo and render [h, w, 3], depth [h, w], its camera.

    depth is along the axis, and NaN where it is unknown or the photo does not count.
    learned: whether the photo is one that the render was learned from.
    """

    photo: np.ndarray
    render: np.ndarray
    depth: np.ndarray
    pixtocam: np.ndarray
    camtoworld: np.ndarray
    counts: np.ndarray
    learned: bool = True


class Found(NamedTuple):
    """[h, w] bool: where a photo shows what others lack, or its own render.

    known: where others tell it. counts: where its render does: nowhere, unless learned.
    """

    apart: np.ndarray
    lacked: np.ndarray
    known: np.ndarray
    counts: np.ndarray

    @property
    def shown(self):
        """[h, w] bool: either."""
        return self.apart | self.lacked

    @property
    def share(self):
        """Of what is known, what is shown; NaN of nothing."""
        return share_of(self.shown & self.known, self.known)


def share_of(mask, known):
    count = known.sum()
    return float(mask.sum() / count) if count else np.nan


def fraction(found):
    """Of what photos show, what others and own renders lack; NaN where nothing tells.

    found: a `Found` of each view. The geometric mean of both shares: either may err.
    """
    apart, lacked = (
        [share for mask, known in pairs if np.isfinite(share := share_of(mask, known))]
        for pairs in (
            [(one.apart, one.known) for one in found],
            [(one.lacked, one.counts) for one in found],
        )
    )
    if not apart or not lacked:
        return np.nan
    return float(np.sqrt(np.mean(apart) * np.mean(lacked)))


def small(view: exposure.View, render, learned=True) -> View:
    """The parts of a view and its render [h, w, 3] that others are compared with."""
    k = -(-max(view.depth.shape) // LONGEST_PX)
    chosen, pixtocam = exposure.every_kth(k, view.pixtocam)
    sigma = max(SIGMA_FRACTION * max(view.depth.shape), 0.5 * k)
    pair = (
        cv2.GaussianBlur(one, (0, 0), sigma)[chosen] for one in (view.photo, render)
    )
    depth = view.depth[chosen].astype(np.float32)
    counts = np.ones(depth.shape, bool)
    if view.counts is not None:
        counts = view.counts[chosen]
    depth = np.where(counts & np.isfinite(depth) & (depth > 0), depth, np.nan)
    return View(*pair, depth, pixtocam, view.camtoworld, counts, learned)


def found(views):
    """`Found` of each `View`."""
    return [
        of_view(view, [views[i] for i in near])
        for view, near in zip(views, exposure.nearest(views, NEIGHBOURS), strict=True)
    ]


def of_view(view: View, others) -> Found:
    """`Found` of a view by other ones."""
    if len(others) < MIN_AGREE:
        return unknown(view.depth.shape)
    own = view.photo.astype(np.float32)
    moved = np.stack([alike(moved_into(view, other), own) for other in others])
    # Unknown ones come last.
    order = np.sort(moved, axis=0)
    count = np.isfinite(moved[..., 0]).sum(axis=0)
    agreed = middle(order, count)
    spread = middle(np.sort(np.abs(moved - agreed), axis=0), count).mean(axis=-1)
    known = (count >= MIN_AGREE) & view.counts
    agreed = np.where(known[..., None], agreed, 0)
    render = alike(view.render.astype(np.float32), own)
    off, left = (np.abs(own - one).mean(axis=-1) for one in (agreed, render))
    apart = parts(
        *(own, agreed, off, known, spread),
        lambda total: total(left) > UNLIKE_RENDER * total(off),
    )
    counts = view.counts & view.learned
    lacked = parts(
        *(own, render, left, counts, 0),
        lambda total: (
            (total(known) > MIN_SEEN * total(counts))
            & (total(off * known) > UNLIKE_OTHERS * total(left * known))
        ),
    )
    # A photo that differs nearly everywhere is another one, or its camera is wrong.
    usable = known.mean() > MIN_KNOWN and apart.sum() < MAX_PART * known.sum()
    found = Found(apart, lacked, known, counts)
    return found if usable else unknown(known.shape)


def unknown(shape):
    """`Found` of a view [h, w] of which nothing is known."""
    return Found(*(np.zeros(shape, bool) for _ in Found._fields))


def middle(ordered, count):
    """Median [h, w, 3] of the first `count` [h, w] of values [n, h, w, 3]; or NaN."""
    places = np.stack(
        [np.maximum(count - 1, 0) // 2, np.minimum(count // 2, len(ordered) - 1)]
    )
    return np.take_along_axis(ordered, places[..., None], axis=0).mean(axis=0)


def opened(seen):
    """A mask without what is as narrow as an edge."""
    size = 2 * round(max(SIGMA_FRACTION * max(seen.shape), 1)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    return cv2.morphologyEx(seen.astype(np.uint8), cv2.MORPH_OPEN, disc)


def parts(own, other, off, known, spread, is_told):
    """[h, w] bool: where a photo shows something else than another picture, no shadow.

    own, other [h, w, 3]; off [h, w]: levels that they are apart by, where `known`
    [h, w]; spread [h, w]: by how much the other is unsure.
    is_told: (function that sums [h, w] over each part) -> [parts] bool: which count.
    """
    usual = np.percentile(off[known], 75) if known.any() else np.inf
    weak, strong = (
        opened(known & (off > np.maximum(max(levels, spreads * usual), times * spread)))
        for levels, times, spreads in (WEAK, STRONG)
    )
    _, labels = cv2.connectedComponents(weak)

    def total(values):
        return np.bincount(labels.ravel(), np.ravel(values), labels.max() + 1)

    gain = total((own * other).sum(-1)) / np.maximum(total((other**2).sum(-1)), 1)
    left = np.abs(own - gain[labels][..., None] * other).mean(axis=-1)
    kept = total(strong) >= max(MIN_PART * known.sum(), 1)
    kept &= (total(left) > SHADE * total(weak)) & is_told(total)
    kept[0] = False
    return kept[labels]


def moved_into(view: View, other: View):
    """What another photo shows [h, w, 3] where that lies in a view; NaN: unknown."""
    h, w = view.depth.shape
    y, x = np.nonzero(np.isfinite(other.depth))
    shown = np.full((h * w, 3), np.nan, np.float32)
    # Both cameras in one matrix, which is faster than points of the world between.
    axes = cameras.OPENGL_FROM_OPENCV
    into = np.linalg.inv(view.pixtocam) @ axes @ view.camtoworld[:, :3].T
    out = into @ other.camtoworld[:, :3] @ axes @ other.pixtocam
    pixels = np.stack([x + 0.5, y + 0.5, np.ones(len(x))])
    points = out @ (other.depth[y, x] * pixels)
    points += (into @ (other.camtoworld[:, 3] - view.camtoworld[:, 3]))[:, None]
    depth = points[2]
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = points[:2] / depth
    inside = (depth > 0) & (u >= 0) & (v >= 0) & (u < w) & (v < h)
    at = v[inside].astype(int) * w + u[inside].astype(int)
    depth = depth[inside].astype(np.float32)
    near = np.full(h * w, np.inf, np.float32)
    np.minimum.at(near, at, depth)
    front = cv2.medianBlur(near.reshape(h, w), 3).ravel()
    # What lies behind shows through the holes of what is in front; floaters are sparse.
    first = depth <= np.minimum(near[at], BEHIND * front[at])
    shown[at[first]] = other.photo[y, x][inside][first]
    return shown.reshape(h, w, 3)


def alike(shown, own):
    """As bright as a view's photo, in each channel."""
    known = np.isfinite(shown[..., 0]) & (own.min(axis=-1) > exposure.DARKEST)
    known &= np.maximum(own, shown).max(axis=-1) < exposure.BRIGHTEST
    if known.sum() < MIN_PIXELS:
        return np.full_like(shown, np.nan)
    even = shown * np.median((own[known] + 1) / (shown[known] + 1), axis=0)
    # What is clipped may be any brighter.
    even = np.where(shown > exposure.BRIGHTEST, np.maximum(even, own), even)
    return np.minimum(even, 255)


def write(path, masks):
    """Write {view: [h, w] bool} as an .npz, all of one size; there may be none."""
    shape = next((mask.shape for mask in masks.values()), (0, 0))
    every = np.array([*masks.values()], bool).reshape(len(masks), *shape)
    with open(path, "wb") as file:
        np.savez_compressed(file, names=np.array([*masks], str), shown=every)


def read(path):
    """{view: [h, w] bool} as `write` wrote it; ValueError names a file that is not."""
    data = archives.read(path, ("names", "shown"))
    if data["names"].ndim != 1 or data["shown"].shape[:1] != data["names"].shape:
        raise ValueError(f"{path}: there is not one mask for each name")
    return dict(zip(data["names"].tolist(), data["shown"], strict=True))


def of_photo(mask, size):
    """A mask in a photo of (width, height), with a little more around it."""
    wider = cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8))
    return cv2.resize(wider, size, interpolation=cv2.INTER_NEAREST) > 0
