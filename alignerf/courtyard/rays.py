"""What rays from a camera meet in the courtyard, and at what depth.

Notation: image positions x_px, y_px [N] with pixel centres at +0.5. Directions have
depth 1 along the optical axis, so that a ray's parameter t *is* the depth in metres;
vectors of N rays are held as (x, y, z) of arrays [N], in the dtype of x_px.
`displacements` [objects, 3] in metres moves each object as a whole. A `part` is the
index of a surface: the boxes, then the ground, the rings, the sky.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from alignerf.courtyard import world as courtyard_world
from alignerf.scenes import cameras


class Hits(NamedTuple):
    """The first surface on each ray, and the camera they left.

    Depth t in metres; directions x, y, z.
    """

    t: Float[np.ndarray, " n"]
    part: Int[np.ndarray, " n"]
    directions: tuple[Float[np.ndarray, " n"], ...]
    camera: Float[np.ndarray, " 3"]


def ray_directions(x_px, y_px, pixtocam, camtoworld):
    """Directions 3 x [N] through image positions."""
    matrix = camtoworld[:, :3] @ cameras.OPENGL_FROM_OPENCV @ pixtocam
    matrix = matrix.astype(x_px.dtype)
    return tuple(row[0] * x_px + row[1] * y_px + row[2] for row in matrix)


def box_candidates(box, shift, x_px, y_px, pixtocam, camtoworld):
    """Indices of the rays that may meet a box: in its bounding rectangle, if any."""
    signs = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, 8)
    corners = (box.rotation @ (signs * box.half[:, None])).T + box.centre + shift
    corners_px, depth = cameras.project(corners, pixtocam, camtoworld)
    if depth.min() < 1e-3:
        # A box beside the camera has no bounding rectangle.
        return np.arange(len(x_px)) if depth.max() > 0 else np.arange(0)
    # Slack for positions in float32.
    (left, top), (right, bottom) = corners_px.min(0) - 0.01, corners_px.max(0) + 0.01
    inside = (x_px >= left) & (x_px <= right) & (y_px >= top) & (y_px <= bottom)
    return np.flatnonzero(inside)


def to_box(box, shift, camera, directions):
    """Camera centre [3], from the box's centre, and directions 3 x [N], on its axes."""
    dtype = directions[0].dtype
    origin = (box.rotation.T @ (camera - shift - box.centre)).astype(dtype)
    axes = box.rotation.T.astype(dtype)
    x, y, z = directions
    return origin, [row[0] * x + row[1] * y + row[2] * z for row in axes]


def hit_box(box, origin, along):
    """Depth [N] where rays enter a box, and the axis of the face that they enter by.

    Infinite where they miss it or begin inside.
    """
    near = np.full_like(along[0], 0)
    far = np.full_like(along[0], np.inf)
    axis = np.zeros(len(near), np.int8)
    for k in range(3):
        # A ray in the plane of a face: a huge inverse, never 0 / 0.
        safe = np.where(
            np.abs(along[k]) < 1e-12, np.asarray(1e-12, near.dtype), along[k]
        )
        inverse = 1 / safe
        middle = -origin[k] * inverse
        reach = box.half[k].astype(near.dtype) * np.abs(inverse)
        enters = middle - reach
        axis[enters > near] = k
        np.maximum(near, enters, out=near)
        np.minimum(far, middle + reach, out=far)
    return np.where((near < far) & (near > 0), near, np.inf), axis


def azimuth(x, y):
    """Angle in 0..2 pi about z, 0 behind the middle camera, pi ahead of it."""
    return np.arctan2(-x, -y) % (2 * np.pi)


def hit_ring(ring, camera, directions):
    """Depth [N] where rays meet a ring from inside; infinite above its top, below 0."""
    dx, dy, dz = directions
    x, y, z = camera.astype(dx.dtype)
    a = np.maximum(dx * dx + dy * dy, np.asarray(1e-12, dx.dtype))
    b = dx * x + dy * y
    c = x * x + y * y - np.asarray(ring.radius**2, dx.dtype)
    depth = (np.sqrt(np.maximum(b * b - a * c, 0)) - b) / a
    turn = azimuth(x + depth * dx, y + depth * dy) / (2 * np.pi)
    top = np.interp(turn * (len(ring.tops) - 1), np.arange(len(ring.tops)), ring.tops)
    height = z + depth * dz
    return np.where((depth > 0) & (height >= 0) & (height < top), depth, np.inf)


def hit_sky(camera, directions):
    """Depth [N] where rays leave the sky's sphere."""
    a = sum(d * d for d in directions)
    b = sum(d * x for d, x in zip(directions, camera.astype(a.dtype), strict=True))
    c = (camera @ camera - courtyard_world.SKY_RADIUS_M**2).astype(a.dtype)
    return (np.sqrt(b * b - a * c) - b) / a


def part_objects(world):
    """Object id [parts] of each part."""
    ids = [box.object_id for box in world.boxes]
    ids.append(courtyard_world.OBJECTS.index("ground"))
    ids += [ring.object_id for ring in world.rings]
    return np.array([*ids, courtyard_world.OBJECTS.index("sky")])


def cast(
    world: courtyard_world.World,
    pixtocam: Float[np.ndarray, "3 3"],
    camtoworld: Float[np.ndarray, "3 4"],
    x_px: Float[np.ndarray, " n"],
    y_px: Float[np.ndarray, " n"],
    displacements: Float[np.ndarray, "objects 3"],
) -> Hits:
    """First surface on the rays through image positions x_px, y_px [N]."""
    directions = ray_directions(x_px, y_px, pixtocam, camtoworld)
    t = np.full_like(x_px, np.inf)
    part = np.full(x_px.shape, -1, np.int16)
    hits = Hits(t, part, directions, camtoworld[:, 3])
    shifts = displacements[part_objects(world)]
    for k, box in enumerate(world.boxes):
        rays = box_candidates(box, shifts[k], x_px, y_px, pixtocam, camtoworld)
        if len(rays):
            some = tuple(d[rays] for d in directions)
            origin, along = to_box(box, shifts[k], hits.camera, some)
            keep_nearer(hits, rays, hit_box(box, origin, along)[0], k)
    k = len(world.boxes)
    if world.ground:
        down = np.flatnonzero(directions[2] < 0)
        height = (hits.camera[2] - shifts[k, 2]).astype(t.dtype)
        keep_nearer(hits, down, -height / directions[2][down], k)
    for ring, shift in zip(world.rings, shifts[k + 1 : -1], strict=True):
        k += 1
        # Nearer hits lie inside the ring, at any angle of view up to 170 degrees.
        rays = np.flatnonzero(t > 0.05 * ring.radius)
        depth = hit_ring(ring, hits.camera - shift, [d[rays] for d in directions])
        keep_nearer(hits, rays, depth, k)
    rays = np.flatnonzero(np.isinf(t))
    depth = hit_sky(hits.camera - shifts[-1], [d[rays] for d in directions])
    keep_nearer(hits, rays, depth, k + 1)
    return hits


def keep_nearer(hits, rays, depth, part):
    """Enter into hits, in place, the rays [M] whose depth [M] is a new minimum."""
    nearer = depth < hits.t[rays]
    hits.t[rays[nearer]] = depth[nearer]
    hits.part[rays[nearer]] = part


def ends(hits):
    """Where the rays end, 3 x [N] in the world."""
    centre = hits.camera.astype(hits.t.dtype)
    return [c + hits.t * d for c, d in zip(centre, hits.directions, strict=True)]
