"""The colour that rays see where they meet a surface of the courtyard.

Notation: M rays on one surface; u, v [M] fractions of a texture's width and height
from its upper left corner; a ray's footprint is the part of a surface that it stands
for; a pyramid's level is 0 at the finest texture and grows by one for each halving.
Directions and depths as in `rays`.
"""

from typing import NamedTuple

import cv2
import numpy as np

from alignerf.courtyard import rays as courtyard_rays
from alignerf.courtyard import world as courtyard_world


class View(NamedTuple):
    """M rays that meet one surface, moved back with it to where its object rests.

    directions 3 x [M] and slant [M], their length; depth t [M]; camera [3]; width
    [M] of a ray's footprint on a surface that faces it, in metres.
    """

    directions: tuple
    slant: np.ndarray
    t: np.ndarray
    camera: np.ndarray
    width: np.ndarray


def sample(pyramid, u, v, level):
    """Colours [M, 3] in 0..255 of a texture, bilinear in two levels and between."""
    colour = np.zeros((len(u), 3), np.float32)
    level = np.clip(level, 0, len(pyramid) - 1)
    for k in range(int(level.min()), int(np.ceil(level.max())) + 1):
        weight = 1 - np.abs(level - k)
        rays = np.flatnonzero(weight > 0)
        height, width = pyramid[k].shape[:2]
        x, y = u[rays] * width - 0.5, v[rays] * height - 0.5
        colour[rays] += weight[rays, None] * gather(pyramid[k], x, y)
    return colour


def gather(texture, x, y):
    """Bilinear lookup [M, 3] at array positions x, y [M]."""
    # OpenCV refuses sides over 32766: the positions are folded into rows.
    shape = (-(-len(x) // 4096), 4096)
    folded = [np.zeros(shape, np.float32) for _ in range(2)]
    for fold, value in zip(folded, (x, y), strict=True):
        fold.reshape(-1)[: len(value)] = value
    values = cv2.remap(
        texture, *folded, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    return values.reshape(-1, 3)[: len(x)]


def level_of(view, across, texel_m):
    """Level whose texel is as wide as a ray's footprint.

    across [M]: the directions' component along the normal (of a ring, any horizontal
    one counts). Footprints are ellipses; the geometric mean of the axes is between
    aliasing and blur.
    """
    cosine = np.maximum(np.abs(across) / view.slant, 0.02)
    return np.log2(view.width / texel_m / np.sqrt(cosine) + 1e-9)


def positions(view):
    """Where the rays end, 3 x [M], in the world with the object at rest."""
    centre = view.camera.astype(view.t.dtype)
    return [c + view.t * d for c, d in zip(centre, view.directions, strict=True)]


def box_colours(box, view):
    """Colours [M, 3] of rays that meet a box."""
    origin, along = courtyard_rays.to_box(box, 0.0, view.camera, view.directions)
    _, axis = courtyard_rays.hit_box(box, origin, along)
    local = [o + view.t * d for o, d in zip(origin, along, strict=True)]
    colour = np.zeros((len(view.t), 3), np.float32)
    for k in range(3):
        across, up = [(1, 2), (0, 2), (0, 1)][k]
        for side in (0, 1):
            rays = np.flatnonzero((axis == k) & ((along[k] < 0) == side))
            if not len(rays):
                continue
            pyramid = box.faces[2 * k + side]
            u = 0.5 + 0.5 * local[across][rays] / np.float32(box.half[across])
            v = 0.5 - 0.5 * local[up][rays] / np.float32(box.half[up])
            texel_m = 2 * box.half[up] / pyramid[0].shape[0]
            some = view._replace(width=view.width[rays], slant=view.slant[rays])
            level = level_of(some, along[k][rays], np.float32(texel_m))
            colour[rays] = sample(pyramid, u, v, level)
    return colour


def ground_colours(squares, view):
    """Colours [M, 3] of rays that meet the ground.

    Of the squares the smallest holds; the largest one's border goes on for ever.
    """
    x, y, _ = positions(view)
    reach = np.maximum(np.abs(x), np.abs(y))
    colour = np.zeros((len(view.t), 3), np.float32)
    inner = 0.0
    for k, (half_m, pyramid) in enumerate(squares):
        outer = half_m if k < len(squares) - 1 else np.inf
        rays = np.flatnonzero((reach >= inner) & (reach < outer))
        inner = outer
        if len(rays):
            some = view._replace(width=view.width[rays], slant=view.slant[rays])
            texel_m = np.float32(2 * half_m / len(pyramid[0]))
            level = level_of(some, view.directions[2][rays], texel_m)
            u, v = 0.5 + x[rays] / (2 * half_m), 0.5 + y[rays] / (2 * half_m)
            colour[rays] = sample(pyramid, u, v, level)
    return colour


def ring_colours(ring, view):
    """Colours [M, 3] of rays that meet a ring; its texture reaches the highest top."""
    x, y, z = positions(view)
    u = courtyard_rays.azimuth(x, y) / np.float32(2 * np.pi)
    v = 1 - z / np.float32(ring.tops.max())
    texel_m = 2 * np.pi * ring.radius / ring.pyramid[0].shape[1]
    radial = np.hypot(view.directions[0], view.directions[1])
    return sample(ring.pyramid, u, v, level_of(view, radial, np.float32(texel_m)))


def sky_colours(pyramid, view):
    """Colours [M, 3] of rays that meet the sky, by azimuth and elevation."""
    x, y, z = positions(view)
    u = courtyard_rays.azimuth(x, y) / np.float32(2 * np.pi)
    v = 1 - np.arctan2(z, np.hypot(x, y)) / np.float32(np.pi / 2)
    texel_m = 2 * np.pi * courtyard_world.SKY_RADIUS_M / pyramid[0].shape[1]
    return sample(pyramid, u, v, level_of(view, view.slant, np.float32(texel_m)))


def colours(world, hits, displacements, spacing):
    """Colours [N, 3] float32 in 0..255; spacing: of the rays, in metres at depth 1."""
    shifts = displacements[courtyard_rays.part_objects(world)]
    boxes, rings = len(world.boxes), len(world.rings)
    seen = np.zeros((len(hits.t), 3), np.float32)
    for k in np.unique(hits.part):
        rays = np.flatnonzero(hits.part == k)
        t = hits.t[rays]
        directions = tuple(d[rays] for d in hits.directions)
        slant = np.sqrt(sum(d * d for d in directions))
        camera = hits.camera - shifts[k]
        view = View(directions, slant, t, camera, t * np.float32(spacing))
        if k < boxes:
            seen[rays] = box_colours(world.boxes[k], view)
        elif k == boxes:
            seen[rays] = ground_colours(world.ground, view)
        elif k <= boxes + rings:
            seen[rays] = ring_colours(world.rings[k - boxes - 1], view)
        else:
            seen[rays] = sky_colours(world.sky, view)
    return seen
