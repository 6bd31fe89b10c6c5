"""Crops: a scene around one of its points, at its photos' own size.

A crop is a square of each photo around where a 3D point is seen. With its own
pixtocams, shifted by the crop's corner, it is a view like any other. So a training
sees pixels of the photo where the whole photos would take hours.

Notation: points [m, 3] in world units, n views, xy [n, m, 2] in px of the photo (pixel
centres at +0.5).
"""

import functools
import logging
from typing import NamedTuple

import numpy as np
from scipy import spatial

from alignerf.captures import base
from alignerf.colmap import loading
from alignerf.scenes import cameras, prepare, prepared

log = logging.getLogger("alignerf.poses")

# Points that are looked at more closely; the others are seen by fewer views.
MAX_CANDIDATES = 2000
# Of more points than this only some are looked at, evenly: 300 photos of 12 megapixels
# have 156,000, and where all photos see all of them is a gigabyte.
MAX_POINTS = 30_000
# Two crops show other things where their points are as far apart, in crops.
APART = 1.0
# Where no crop suits, a smaller one is looked for, down to what flow can be told of.
SMALLER, MIN_PX = 0.75, 32
# With more photos than this, each has one crop.
MANY = 100
# A crop whose mask leaves less than this share is left out.
MIN_COUNTED = 0.5


class Seen(NamedTuple):
    """Where views see points.

    inside [n, m]: whether the whole crop around a point lies in the photo.
    """

    xy: np.ndarray
    depth: np.ndarray
    inside: np.ndarray


def places(views: prepare.PosedViews, px, count, *, least):
    """(points [k, 3], px): up to `count` places, and the side of their crops.

    Crops are as large as there are enough of them: a scene of small photos has
    smaller ones. Raises ValueError where there is none.
    """
    if views.points is None or not len(views.points[0]):
        raise ValueError("the views share no points")
    points = views.points[0]
    points = points[:: -(-len(points) // MAX_POINTS)]
    best = (np.zeros((0, 3)), 0)
    count = 1 if len(views.names) > MANY else count
    while len(best[0]) < count and px >= MIN_PX:
        try:
            chosen = choose(points, views, px, count, least=least)
        except ValueError as error:
            why = error
        else:
            best = max(best, (chosen, px), key=lambda one: len(one[0]))
        px = int(SMALLER * px)
    if not len(best[0]):
        raise why
    return best


def seen(points, views: prepare.PosedViews, px) -> Seen:
    """Where the views see points [m, 3], and which crops of `px` lie inside."""
    pairs = zip(views.pixtocams, views.camtoworlds, strict=True)
    places = [cameras.project(points, *camera) for camera in pairs]
    xy, depth = (np.stack(parts) for parts in zip(*places, strict=True))
    corner = np.round(np.where(depth[..., None] > 0, xy, -px) - px / 2)
    size = np.array([views.width, views.height])
    inside = (depth > 0) & ((corner >= 0) & (corner + px <= size)).all(axis=-1)
    return Seen(xy, depth, inside)


def choose(points, views: prepare.PosedViews, px, count, *, least):
    """Up to `count` points [count, 3] to look at, the best first.

    Crops around them lie in nearly all photos, on texture (points are found where
    there is some), near the middle of the depths, and show different things. least:
    views that a crop needs. Raises ValueError where no point has as many.
    """
    whole = seen(points, views, px)
    share = whole.inside.sum(axis=0)
    candidates = np.argsort(-share, kind="stable")[:MAX_CANDIDATES]
    candidates = candidates[share[candidates] >= least]
    if not len(candidates):
        most = int(share.max(initial=0))
        raise ValueError(
            f"no crop of {px} px lies in {least} photos or more (the best in {most} "
            f"of {len(views.names)}): take a smaller one"
        )
    middle = np.median(whole.depth[whole.depth > 0])
    depth = np.median(np.abs(whole.depth[:, candidates]), axis=0)
    texture = neighbours(whole, candidates, px)
    score = share[candidates] / len(views.names)
    score = score * np.sqrt(texture / max(texture.max(), 1))
    score = score * np.exp(-np.abs(np.log(np.maximum(depth, 1e-12) / middle)))
    chosen = []
    for best in candidates[np.argsort(-score, kind="stable")]:
        if len(chosen) < count and all(apart(whole, best, c, px) for c in chosen):
            chosen.append(best)
    return points[chosen]


def neighbours(whole: Seen, candidates, px):
    """Points in each candidate's crop [c]: the median over views that have it."""
    counts = np.full((len(whole.xy), len(candidates)), np.nan)
    for view, (xy, depth) in enumerate(zip(whole.xy, whole.depth, strict=True)):
        has = whole.inside[view, candidates]
        if not has.any():
            continue
        # Within half a crop along both axes; all pairs would be gigabytes.
        tree = spatial.cKDTree(xy[depth > 0])
        counts[view, has] = tree.query_ball_point(
            xy[candidates[has]],
            np.nextafter(px / 2, 0),
            p=np.inf,
            return_length=True,
        )
    return np.nanmedian(counts, axis=0)


def apart(whole: Seen, first, second, px):
    """Whether two points' crops show different things, in the median view."""
    away = np.abs(whole.xy[:, first] - whole.xy[:, second]).max(axis=-1)
    both = (whole.depth[:, first] > 0) & (whole.depth[:, second] > 0)
    return bool(np.median(away[both]) >= APART * px) if both.any() else True


class Crops(NamedTuple):
    """Where crops of `px` lie: in which views, and their corners [k, 2], x first."""

    px: int
    kept: np.ndarray
    corners: np.ndarray


def around(point, views: prepare.PosedViews, px, *, least) -> Crops:
    """The crops of `px` around a point [3], in the views that have them whole.

    Raises ValueError where fewer than `least` do.
    """
    whole = seen(np.asarray(point, np.float64)[None], views, px)
    kept = np.flatnonzero(whole.inside[:, 0])
    if len(kept) < least:
        raise ValueError(
            f"a crop of {px} px around {np.round(point, 4).tolist()} lies in "
            f"{len(kept)} photos, under {least}: take a smaller one"
        )
    return Crops(px, kept, np.round(whole.xy[kept, 0] - px / 2).astype(int))


def that_count(views: prepare.PosedViews, crops: Crops) -> Crops:
    """The crops of which at least a half counts, by the masks of their photos."""
    if views.masks is None:
        return crops
    counted = []
    for view, corner in zip(crops.kept, crops.corners, strict=True):
        mask = piece_at(corner, crops.px)(views.masks[view].read())
        counted.append((mask >= prepare.WHITE).all(axis=-1).mean() >= MIN_COUNTED)
    counted = np.array(counted, bool)
    return crops._replace(kept=crops.kept[counted], corners=crops.corners[counted])


def cut(views: prepare.PosedViews, crops: Crops) -> prepare.PosedViews:
    """The crops as views: photos are cut when they are read, cameras shifted."""
    views, px = prepare.select(views, crops.kept), crops.px

    def pieces(photos):
        places = zip(photos, crops.corners, strict=True)
        return [photo.then(piece_at(corner, px)) for photo, corner in places]

    made = views._replace(
        pixtocams=shifted(views.pixtocams, crops),
        width=px,
        height=px,
        photos=pieces(views.photos),
        masks=views.masks and pieces(views.masks),
        # They are of the whole photo.
        bounds=None,
    )
    return made._replace(points=inside_of(made))


def cut_several(views: prepare.PosedViews, several) -> prepare.PosedViews:
    """The crops at several places as views, called <photo>_w0, <photo>_w1.

    several: a `Crops` for each place, of one size. The views have a split. Read in
    their order, each photo is decoded once.
    """
    views = views._replace(
        photos=read_once(views.photos), masks=views.masks and read_once(views.masks)
    )
    parts = [cut(views, one) for one in several]
    joined = prepare.join(parts, masked=views.masks is not None)
    joined = joined._replace(
        names=[f"{n}_w{k}" for k, part in enumerate(parts) for n in part.names],
        split=np.concatenate([part.split for part in parts]),
        points=views.points,
    )
    return prepare.sort_by_name(joined._replace(points=inside_of(joined)))


def read_once(photos):
    """The same photos; one that is read again at once is not decoded again."""

    @functools.lru_cache(maxsize=1)
    def read(i):
        return photos[i].read()

    return [prepare.Photo(i, (read,)) for i in range(len(photos))]


def shifted(pixtocams, crops: Crops):
    """Inverse intrinsics [k, 3, 3] of the crops, from those of their photos."""
    shift = np.tile(np.eye(3), (len(pixtocams), 1, 1))
    shift[:, :2, 2] = crops.corners
    return pixtocams @ shift


def piece_at(corner, px):
    """A function that cuts a crop out of an image [h, w, ...]."""
    left, top = corner
    return lambda image: image[top : top + px, left : left + px]


def inside_of(views: prepare.PosedViews):
    """Of the views' points and colours those that two of them or more see."""
    if views.points is None:
        return None
    points, colours = views.points
    counts, size = np.zeros(len(points), int), (views.width, views.height)
    for camera in zip(views.pixtocams, views.camtoworlds, strict=True):
        xy, depth = cameras.project(points, *camera)
        counts += (depth > 0) & ((xy >= 0) & (xy <= size)).all(axis=-1)
    return points[counts > 1], colours[counts > 1]


def placed(views, config, like):
    """(views with their points, places [k, 3], px) of the crops of a whole scene."""
    if like:
        views = views._replace(points=loading.points_of(like))
        there = prepared.read_poses(like, {"crop": prepared.CROP})["crop"]
        return views, np.array(there["points"]), there["px"]
    views = with_focus(views)
    least = config.min_train_views + 1
    size = base.of(config).size(config)
    return views, *places(views, *size, least=least)


def around_each(views, points, px, *, least):
    """(places, their `Crops`) of those seen by views of both splits.

    Raises ValueError where there is none.
    """
    found = []
    for point in points:
        try:
            one = around(point, views, px, least=least)
        except ValueError as error:
            log.warning("%s", error)
            continue
        one = that_count(views, one)
        split = views.split[one.kept]
        if (split == "train").sum() >= least - 1 and (split == "test").any():
            found.append((np.asarray(point).tolist(), one))
    if not found:
        what = "seen by enough photos to learn from and to judge by"
        raise ValueError(f"no place is {what}")
    return [point for point, _ in found], [one for _, one in found]


def with_focus(views):
    """The views, where they share no points, with the one that they all look at."""
    focus = cameras.focus_of(views.camtoworlds)
    if views.points is not None or focus is None:
        return views
    return views._replace(points=(focus[None], np.zeros((1, 3), np.uint8)))
