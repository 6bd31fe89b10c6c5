"""Depth of another program's renders: found, read, and brought to the cameras' unit.

A program writes depth along the optical axis or distance along the ray, in a unit of
its own. The points that cameras came with tell which, and the unit. Without any depth,
points give a coarse one; without points all is taken for far away.

Notation: `depth` [h, w] float32 along the optical axis, in the unit of the cameras;
NaN or 0 where unknown, infinite where far away.
"""

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from alignerf.io import archives, images
from alignerf.scenes import cameras, distortion, photo_names
from alignerf.scenes.external import renders

IMAGES = (".tiff", ".tif", ".png")
SUFFIXES = (".npz", ".npy", ".npy.gz", *IMAGES)
KINDS = ("depth", "distance")
# Ratios of depths at fewer points tell nothing.
MIN_POINTS = 50
# Views that are looked at for the unit, and the side in px of a cell in which the
# nearest points count: those behind are hidden.
SEEN_VIEWS, CELL_PX = 12, 16


class Unit(NamedTuple):
    """What turns a program's numbers into depth: `kind` of KINDS, and a factor.

    spread: of the logarithm of the ratios to the points, as a median deviation; NaN
    where no points have told.
    """

    kind: str
    scale: float
    spread: float


def find(folder, names):
    """{view: path} of the depths of a folder, which are called like their views.

    Raises ValueError naming the folder where there are none that can be read.
    """
    folder, groups = Path(folder), {}
    if not folder.is_dir():
        raise ValueError(f"{folder}: no folder of depths")
    called = renders.Called({name: name for name in names})
    inside = (
        Path(r, file) for r, _, files in photo_names.walk(folder) for file in files
    )
    for path in sorted(inside):
        suffix = next((s for s in SUFFIXES if path.name.lower().endswith(s)), None)
        if path.suffix.lower() == ".exr":
            raise ValueError(
                f"{path}: EXR is not read here: write .npy, or .tiff of 32 bits"
            )
        if suffix is None:
            continue
        name, _ = called.view_of(path.with_name(path.name[: -len(suffix)]))
        if name is not None:
            # Beside depths lie others, and pictures: of one kind there is one folder,
            # or one for each split.
            group = groups.setdefault((suffix == ".png", path.parent.name, suffix), {})
            if name in group:
                raise ValueError(f"{group[name]} and {path}: both of view {name}")
            group[name] = path
    if not groups:
        raise ValueError(f"{folder}: no depths ({', '.join(SUFFIXES)}) of the views")
    # Numbers before pictures, then what is called depth alone, then what is most.
    best = min(groups, key=lambda key: (key[0], rank(key[1]), -len(groups[key])))
    return groups[best]


def rank(folder):
    """How far a folder's name is from that of plain depth."""
    order = ("raw-depth", "depth", "raw-expected_depth")
    return order.index(folder) if folder in order else len(order)


def read(path):
    """The numbers of a file [h, w] float32; ValueError naming it where it has none."""
    is_image = Path(path).suffix.lower() in IMAGES
    values = np.squeeze((images if is_image else archives).read_numbers(path))
    if values.ndim != 2 or 0 in values.shape:
        raise ValueError(f"{path}: {values.dtype} {list(values.shape)} is no depth")
    # What float32 does not hold is far away.
    with np.errstate(over="ignore"):
        return values.astype(np.float32)


def along_axis(values, kind, pixtocam):
    """Depth along the optical axis of what a file has, still in its unit."""
    if kind == "depth":
        return values
    height, width = values.shape
    y, x = np.indices((height, width)) + 0.5
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.asarray(pixtocam).T
    rays = rays / rays[..., 2:]
    return (values / np.linalg.norm(rays, axis=-1)).astype(np.float32)


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


def unit_of(paths, views, points) -> Unit:
    """The `Unit` of the files {view: path} by the points that cameras came with.

    views: {view: (pixtocam, camtoworld, (width, height), lens)}, the lens as of
    `as_shown`. points: positions [m, 3], or None; too few leave numbers as they are.
    """
    if points is None:
        return Unit("depth", 1.0, np.nan)
    ratios = {kind: [] for kind in KINDS}
    names = [name for name in paths if name in views]
    step = max(len(names) // SEEN_VIEWS, 1)
    for name in names[::step]:
        pixtocam, camtoworld, size, lens = views[name]
        column, row, depth = visible(points, pixtocam, camtoworld, size)
        values = as_shown(read(paths[name]), pixtocam, size, lens)
        for kind in KINDS:
            own = along_axis(values, kind, pixtocam)[row, column]
            good = np.isfinite(own) & (own > 0)
            ratios[kind].append(np.log(depth[good] / own[good]))
    found = []
    for kind in KINDS:
        logs = np.concatenate(ratios[kind]) if ratios[kind] else np.zeros(0)
        if len(logs) < MIN_POINTS:
            return Unit("depth", 1.0, np.nan)
        middle = np.median(logs)
        spread = float(np.median(np.abs(logs - middle)))
        found.append(Unit(kind, float(np.exp(middle)), spread))
    return min(found, key=lambda unit: unit.spread)


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
