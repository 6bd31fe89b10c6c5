"""Depth of renders: found, read, and made of points.

Without any depth, the points that cameras came with give a coarse one; without points
all is taken for far away.

Notation: `depth` [h, w] float32 along the optical axis, in the unit of the cameras;
NaN or 0 where unknown, infinite where far away.
"""

import logging
from pathlib import Path

import cv2
import numpy as np

from alignerf.io import archives
from alignerf.judged import renders
from alignerf.scenes import cameras, distortion, photo_names

log = logging.getLogger("alignerf")

SUFFIXES = (".npz", ".npy")
# Fewer points tell nothing.
MIN_POINTS = 50
# The side in px of a cell in which the nearest points count: those behind are hidden.
CELL_PX = 16
# Depth is in another unit where it is off by more than the first, and in nearly all
# views by the same, to the second. So many points of a view and views tell it.
OFF, ALIKE, MIN_SEEN, MIN_VIEWS = 1.2, 1.1, 20, 3
# What units of length are of one another: mm, cm, m.
UNITS = (10, 100, 1000)


def find(folder, names):
    """{view: path} of the depths of a folder, which are called like their views.

    Raises ValueError naming the folder where there are none, or two of one view.
    """
    folder, found = Path(folder), {}
    if not folder.is_dir():
        raise ValueError(f"{folder}: no folder of depths")
    called = renders.Called({name: name for name in names})
    inside = (
        Path(r, file) for r, _, files in photo_names.walk(folder) for file in files
    )
    for path in sorted(path for path in inside if path.suffix.lower() in SUFFIXES):
        name, _ = called.view_of(path.with_suffix(""))
        if name in found:
            raise ValueError(f"{found[name]} and {path}: both of view {name}")
        if name is not None:
            found[name] = path
    if not found:
        raise ValueError(f"{folder}: no depths ({', '.join(SUFFIXES)}) of the views")
    return found


def read(path):
    """The numbers of a file [h, w] float32; ValueError naming it where it has none."""
    values = np.squeeze(archives.read_numbers(path))
    if values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"{path}: {values.dtype} {list(values.shape)} is no depth")
    # What float32 does not hold is far away.
    with np.errstate(over="ignore"):
        return values.astype(np.float32)


def as_shown(values, pixtocam, size, lens):
    """Numbers of a file as a picture [h, w] of a pinhole has them.

    size: (width, height) of the picture, and of a render. lens: (camtopix, distortion)
    of the render, so that its distortion is undone in its depth too; None without.
    """
    if values.shape != size[::-1]:
        values = cv2.resize(values, size, interpolation=cv2.INTER_NEAREST_EXACT)
    if lens is None:
        return values
    at = distortion.positions(*lens, np.linalg.inv(pixtocam), size)
    return cv2.remap(values, *at, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)


def visible(points, pixtocam, camtoworld, size):
    """(column, row, depth) [m] of the points that a view may see.

    Of points in one cell those count that are not far behind the nearest.
    """
    at, depth = cameras.project(points, pixtocam, camtoworld)
    inside = (depth > 0) & (at >= 0).all(-1) & (at < np.array(size)).all(-1)
    at, depth = at[inside], depth[inside]
    column, row = at.astype(int).T
    cells = row // CELL_PX * (size[0] // CELL_PX + 1) + column // CELL_PX
    nearest = np.full(cells.max() + 1 if len(cells) else 1, np.inf)
    np.minimum.at(nearest, cells, depth)
    seen = depth < 1.3 * nearest[cells]
    return column[seen], row[seen], depth[seen]


def unit_of(where, points, views):
    """What depth is to be divided by to have the unit of the cameras; 1 where unknown.

    points [m, 3]: that photos share. views: (depth [h, w], pixtocam, camtoworld) of
    some. Raises ValueError naming `where` for a factor that is not of two units, and
    the same all over each view.
    """
    ratios, spreads = [], []
    for values, *camera in views:
        column, row, depth = visible(points, *camera, values.shape[::-1])
        own = values[row, column]
        known = np.isfinite(own) & (own > 0)
        if known.sum() >= MIN_SEEN:
            near, middle, far = np.quantile(
                own[known] / depth[known], (0.25, 0.5, 0.75)
            )
            ratios.append(middle)
            spreads.append(far / near)
    if len(ratios) < MIN_VIEWS:
        return 1.0
    low, ratio, high = np.quantile(ratios, (0.1, 0.5, 0.9))
    if 1 / OFF < ratio < OFF or high > ALIKE * low:
        return 1.0
    told = f"{where}: its depth is {ratio:.4g} times that of the points of the photos"
    for unit in (*UNITS, *(1 / one for one in UNITS)):
        if 1 / ALIKE < ratio / unit < ALIKE:
            log.warning("%s: it is divided by %g", told, unit)
            return unit
    if np.median(spreads) > ALIKE:
        # That of a model that has learnt no shape, or along rays, is another matter.
        log.warning("%s, not all over alike: is it along the optical axis?", told)
        return 1.0
    raise ValueError(
        f"{told}: divide it by {ratio:.4g}, so that it has the unit of the cameras"
    )


def of_points(points, pixtocam, camtoworld, size):
    """A coarse depth [h, w] from the points of a view; infinite where it sees too few.

    Between points it is that of the nearest, smoothed.
    """
    width, height = size
    column, row, depth = visible(points, pixtocam, camtoworld, size)
    if len(depth) < MIN_POINTS:
        return np.full((height, width), np.inf, np.float32)
    cells = (height - 1) // CELL_PX + 1, (width - 1) // CELL_PX + 1
    total, count = np.zeros(cells), np.zeros(cells)
    place = row // CELL_PX, column // CELL_PX
    # Means of disparity: a far point must not outweigh near ones.
    np.add.at(total, place, 1 / depth)
    np.add.at(count, place, 1)
    known = count > 0
    _, nearest = cv2.distanceTransformWithLabels(
        (~known).astype(np.uint8), cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    values = np.zeros(nearest.max() + 1)
    values[nearest[known]] = total[known] / count[known]
    disparity = cv2.GaussianBlur(values[nearest].astype(np.float32), (0, 0), 1.0)
    return 1 / cv2.resize(disparity, size, interpolation=cv2.INTER_LINEAR)
