"""Windows: a scene around one of its points, at its photos' own size.

A window is a square of each photo around where a 3D point is seen. With its own
pixtocams, shifted by the window's corner, it is a view like any other. So a training
sees pixels of the photo where the whole photos would take hours.

Notation: points [m, 3] in world units, n views, xy [n, m, 2] in px of the photo (pixel
centres at +0.5).
"""

import functools
from typing import NamedTuple

import numpy as np
from scipy import spatial

from alignerf.files import faults
from alignerf.scenes import cameras, prepare

# Points that are looked at more closely; the others are seen by fewer views.
MOST_CANDIDATES = 2000
# Of more points than this only some are looked at, evenly: 300 photos of 12 megapixels
# have 156,000, and where all photos see all of them is a gigabyte.
MOST_POINTS = 30_000
# Two windows show other things where their points are as far apart, in windows.
APART = 1.0
# Where no window suits, a smaller one is looked for, down to what flow can be told of.
SMALLER, LEAST_PX = 0.75, 32
# With more photos than this, each has one window.
MANY = 100
# A window whose mask leaves less than this share is left out.
LEAST_COUNTED = 0.5


class Seen(NamedTuple):
    """Where views see points.

    inside [n, m]: whether the whole window around a point lies in the photo.
    """

    xy: np.ndarray
    depth: np.ndarray
    inside: np.ndarray


def place(views: prepare.PosedViews, zoom, *, least):
    """The point [3] that a config's `zoom` means; the views have points.

    least: views that a window needs. Raises ValueError where there is none.
    """
    if zoom["point"] is not None:
        return np.array(zoom["point"])
    if views.points is None or not len(views.points[0]):
        raise ValueError("the views share no points: name a `point`")
    points = views.points[0]
    if zoom["view"] is not None:
        return behind(points, views, zoom["view"], zoom["pixel"])
    count = zoom["number"] + 1
    chosen = choose(points, views, zoom["px"], count, least=least)
    if len(chosen) < count:
        raise ValueError(f"number: only {len(chosen)} places suit, counted from 0")
    return chosen[-1]


def places(views: prepare.PosedViews, zoom, *, least):
    """(points [k, 3], px): up to `count` places, and the side of their windows.

    Windows are as large as there are enough of them: a scene of small photos has
    smaller ones. Raises ValueError where there is none.
    """
    if views.points is None or not len(views.points[0]):
        raise ValueError("the views share no points")
    points = views.points[0]
    points = points[:: -(-len(points) // MOST_POINTS)]
    px, best = zoom["px"], (np.zeros((0, 3)), 0)
    count = 1 if len(views.names) > MANY else zoom["count"]
    while len(best[0]) < count and px >= LEAST_PX:
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
    """Where the views see points [m, 3], and which windows of `px` lie inside."""
    pairs = zip(views.pixtocams, views.camtoworlds, strict=True)
    places = [cameras.project(points, *camera) for camera in pairs]
    xy, depth = (np.stack(parts) for parts in zip(*places, strict=True))
    corner = np.round(np.where(depth[..., None] > 0, xy, -px) - px / 2)
    size = np.array([views.width, views.height])
    inside = (depth > 0) & ((corner >= 0) & (corner + px <= size)).all(axis=-1)
    return Seen(xy, depth, inside)


def choose(points, views: prepare.PosedViews, px, count, *, least):
    """Up to `count` points [count, 3] to look at, the best first.

    Windows around them lie in nearly all photos, on texture (points are found where
    there is some), near the middle of the depths, and show different things. least:
    views that a window needs. Raises ValueError where no point has as many.
    """
    whole = seen(points, views, px)
    share = whole.inside.sum(axis=0)
    candidates = np.argsort(-share, kind="stable")[:MOST_CANDIDATES]
    candidates = candidates[share[candidates] >= least]
    if not len(candidates):
        most = int(share.max(initial=0))
        raise ValueError(
            f"no window of {px} px lies in {least} photos or more (the best in {most} "
            f"of {len(views.names)}): take a smaller one, or a point of your own"
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
    """Points in each candidate's window [c]: the median over views that have it."""
    counts = np.full((len(whole.xy), len(candidates)), np.nan)
    for view, (xy, depth) in enumerate(zip(whole.xy, whole.depth, strict=True)):
        has = whole.inside[view, candidates]
        if not has.any():
            continue
        # Within half a window along both axes; all pairs would be gigabytes.
        tree = spatial.cKDTree(xy[depth > 0])
        counts[view, has] = tree.query_ball_point(
            xy[candidates[has]],
            np.nextafter(px / 2, 0),
            p=np.inf,
            return_length=True,
        )
    return np.nanmedian(counts, axis=0)


def apart(whole: Seen, first, second, px):
    """Whether two points' windows show different things, in the median view."""
    away = np.abs(whole.xy[:, first] - whole.xy[:, second]).max(axis=-1)
    both = (whole.depth[:, first] > 0) & (whole.depth[:, second] > 0)
    return bool(np.median(away[both]) >= APART * px) if both.any() else True


def behind(points, views: prepare.PosedViews, name, pixel):
    """The point [3] that a view shows at a pixel (x, y): at its neighbours' depth.

    Raises ValueError for a view that is not there, or a pixel outside or without any
    point near it.
    """
    if name not in views.names:
        few = faults.some_names(sorted(views.names))
        raise ValueError(f"no view {name!r}, only {few}")
    if not all(0 <= at <= side for at, side in zip(pixel, size_of(views), strict=True)):
        width, height = size_of(views)
        raise ValueError(f"{pixel} is not a pixel of {width}x{height}")
    view = views.names.index(name)
    pixtocam, pose = views.pixtocams[view], views.camtoworlds[view]
    xy, depth = cameras.project(points, pixtocam, pose)
    ahead = depth > 0
    away = np.linalg.norm(xy[ahead] - pixel, axis=-1)
    near = away <= max(size_of(views)) / 8
    if not near.any():
        raise ValueError(f"no point of the scene is seen near {pixel} in {name}")
    nearest = np.argsort(away, kind="stable")[: min(8, near.sum())]
    depth = np.median(depth[ahead][nearest])
    inside = depth * (pixtocam @ [*pixel, 1.0]) * [1, -1, -1]
    return pose[:, :3] @ inside + pose[:, 3]


def size_of(views):
    """(width, height)."""
    return views.width, views.height


class Windows(NamedTuple):
    """Where windows of `px` lie: in which views, and their corners [k, 2], x first."""

    px: int
    kept: np.ndarray
    corners: np.ndarray


def around(point, views: prepare.PosedViews, px, *, least) -> Windows:
    """The windows of `px` around a point [3], in the views that have them whole.

    Raises ValueError where fewer than `least` do.
    """
    whole = seen(np.asarray(point, np.float64)[None], views, px)
    kept = np.flatnonzero(whole.inside[:, 0])
    if len(kept) < least:
        raise ValueError(
            f"a window of {px} px around {np.round(point, 4).tolist()} lies in "
            f"{len(kept)} photos, under {least}: take a smaller one, or another point"
        )
    return Windows(px, kept, np.round(whole.xy[kept, 0] - px / 2).astype(int))


def that_count(views: prepare.PosedViews, windows: Windows) -> Windows:
    """The windows of which at least a half counts, by the masks of their photos."""
    if views.masks is None:
        return windows
    counted = []
    for view, corner in zip(windows.kept, windows.corners, strict=True):
        mask = piece_at(corner, windows.px)(views.masks[view].read())
        counted.append((mask >= prepare.WHITE).all(axis=-1).mean() >= LEAST_COUNTED)
    counted = np.array(counted, bool)
    return windows._replace(
        kept=windows.kept[counted], corners=windows.corners[counted]
    )


def cut(views: prepare.PosedViews, windows: Windows) -> prepare.PosedViews:
    """The windows as views: photos are cut when they are read, cameras shifted."""
    views, px = prepare.select(views, windows.kept), windows.px

    def pieces(photos):
        places = zip(photos, windows.corners, strict=True)
        return [photo.then(piece_at(corner, px)) for photo, corner in places]

    made = views._replace(
        pixtocams=shifted(views.pixtocams, windows),
        width=px,
        height=px,
        photos=pieces(views.photos),
        masks=views.masks and pieces(views.masks),
        # They are of the whole photo.
        bounds=None,
    )
    return made._replace(points=inside_of(made))


def cut_several(views: prepare.PosedViews, several) -> prepare.PosedViews:
    """The windows at several places as views, called <photo>_w0, <photo>_w1.

    several: a `Windows` for each place, of one size. The views have a split. Read in
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


def shifted(pixtocams, windows: Windows):
    """Inverse intrinsics [k, 3, 3] of the windows, from those of their photos."""
    shift = np.tile(np.eye(3), (len(pixtocams), 1, 1))
    shift[:, :2, 2] = windows.corners
    return pixtocams @ shift


def piece_at(corner, px):
    """A function that cuts a window out of an image [h, w, ...]."""
    left, top = corner
    return lambda image: image[top : top + px, left : left + px]


def inside_of(views: prepare.PosedViews):
    """Of the views' points and colours those that two of them or more see."""
    if views.points is None:
        return None
    points, colours = views.points
    counts = np.zeros(len(points), int)
    for camera in zip(views.pixtocams, views.camtoworlds, strict=True):
        xy, depth = cameras.project(points, *camera)
        counts += (depth > 0) & ((xy >= 0) & (xy <= size_of(views))).all(axis=-1)
    return points[counts > 1], colours[counts > 1]
