"""The courtyard's surfaces: where things stand and what they are covered with.

Notation: world in metres, x right, y away from the middle camera, z up, origin on
the ground in the middle of the boxes. An object is what moves as one; several
surfaces may belong to it (its index in OBJECTS is the surfaces' object_id).
"""

import itertools
from typing import NamedTuple

import numpy as np

from alignerf.courtyard import OBJECTS, materials, textures

MOVING = ("carton", "tin", "arm")
# What stands alone, before white, where the place is an `object`.
OF_OBJECT = ("plinth", "trunk", "tower", "case", "carton", "tin", "arm")
SKY_RADIUS_M = 300.0
SUN = np.array([-0.45, -0.55, 0.7])


class Box(NamedTuple):
    """An oriented box; its rotation's columns are its axes, half [3] half its sides.

    faces: six pyramids, ordered -x, +x, -y, +y, -z, +z in its own axes.
    """

    object_id: int
    centre: np.ndarray
    rotation: np.ndarray
    half: np.ndarray
    faces: tuple


class Ring(NamedTuple):
    """A cylinder about the z axis, seen from inside, cut off at a ragged top.

    tops [k]: height over azimuth, which starts behind the middle camera.
    """

    object_id: int
    radius: float
    tops: np.ndarray
    pyramid: list


class World(NamedTuple):
    """All that can be seen; ground: (half side, pyramid) and rings, nearest first.

    An object alone has neither.
    """

    boxes: tuple
    ground: tuple
    rings: tuple
    sky: list


def rotation_z(angle):
    """Rotation [3, 3] about z by an angle in radians."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])


def rotation_x(angle):
    """Rotation [3, 3] about x by an angle in radians."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


def make_box(name, centre, size, rotation, paint):
    """Box with faces painted by paint((width, height) in texels of about 1.2 mm)."""
    faces = []
    for axis in range(3):
        across, up = [(1, 2), (0, 2), (0, 1)][axis]
        texels = tuple(max(round(size[k] / 0.0012), 8) for k in (across, up))
        for side in (-1, 1):
            light = np.maximum(side * rotation[:, axis] @ SUN, 0)
            shade = 0.6 + 0.45 * light
            texture = paint(texels).astype(np.float32) * shade
            texture = np.clip(texture, 0, 255).astype(np.uint8)
            faces.append(textures.pyramid(texture))
    half = np.array(size) / 2
    return Box(OBJECTS.index(name), np.array(centre), rotation, half, tuple(faces))


def make_posters(rng):
    """Boxes covered by photographs, neighbouring faces by different ones."""
    # Name, place x y, size, turn about z.
    plan = [
        ("plinth", (0.05, 0.15), (0.42, 0.36, 0.12), 0.2),
        ("trunk", (-0.5, 0.3), (0.34, 0.26, 0.22), 0.5),
        ("tower", (0.5, 0.45), (0.2, 0.2, 0.46), -0.3),
        ("case", (-0.05, 0.75), (0.4, 0.16, 0.3), 0.1),
        ("carton", (-0.36, -0.24), (0.28, 0.2, 0.3), -0.45),
        ("tin", (0.38, -0.2), (0.23, 0.21, 0.26), 0.7),
    ]
    photos = itertools.cycle(rng.permutation(materials.POSTERS))
    boxes = []
    for name, place, size, turn in plan:
        centre = (*place, size[2] / 2)
        rotation = rotation_z(turn)
        boxes.append(
            make_box(
                name,
                centre,
                size,
                rotation,
                lambda texels: materials.poster(next(photos), texels, rng),
            )
        )
    return boxes


def make_fixtures(rng):
    """The wall, the posts with their wires, and the arm that leans over the plinth."""

    def paint(colour):
        return lambda texels: materials.plain(colour, texels, rng)

    def bricks(texels):
        return materials.brick_wall(0.0012 * texels[1], 0.0012 * texels[0], rng)

    turn = rotation_z(-0.08)
    boxes = [make_box("wall", (0.1, 2.3, 0.3), (4.6, 0.14, 0.6), turn, bricks)]
    feet = [(-0.95, 0.75), (-0.1, 1.15), (0.85, 0.95)]
    post_m, height_m = 0.022, 0.75
    for x, y in feet:
        size = (post_m, post_m, height_m)
        centre = (x, y, height_m / 2)
        boxes.append(
            make_box("posts", centre, size, np.eye(3), paint((0.9, 0.85, 0.3)))
        )
    for (x0, y0), (x1, y1) in itertools.pairwise(feet):
        length = np.hypot(x1 - x0, y1 - y0)
        turn = rotation_z(np.arctan2(y1 - y0, x1 - x0))
        for z in (0.45, 0.6, 0.72):
            centre = ((x0 + x1) / 2, (y0 + y1) / 2, z)
            size = (length, 0.006, 0.006)
            boxes.append(make_box("wires", centre, size, turn, paint((0.9, 0.9, 0.95))))
    lean = rotation_z(-0.6) @ rotation_x(0.5)
    size = (0.05, 0.6, 0.06)
    boxes.append(make_box("arm", (0.1, 0.1, 0.32), size, lean, paint((1.0, 0.6, 0.2))))
    return boxes


def make_rings(rng):
    """Hedge at 25 m and wooded hills at 90 m."""
    azimuth = np.linspace(0, 2 * np.pi, 4096, dtype=np.float32)
    ragged = textures.fractal((8, 4096), 60, rng, octaves=5)[4]
    hedge_tops = 2.6 + 0.9 * np.sin(5 * azimuth) + 0.5 * ragged
    ragged = textures.fractal((8, 4096), 300, rng, octaves=7)[4]
    hill_tops = 11 + 4 * np.sin(3 * azimuth + 1) + 2.5 * ragged
    hedge = materials.foliage((160, 4096), (0.03, 0.07, 0.03), (0.5, 0.6, 0.25), rng)
    hills = materials.foliage((160, 4096), (0.14, 0.22, 0.26), (0.5, 0.6, 0.55), rng)
    return tuple(
        Ring(OBJECTS.index(name), radius, tops, textures.pyramid(texture))
        for name, radius, tops, texture in (
            ("hedge", 25.0, np.maximum(hedge_tops, 1.2), hedge),
            ("hills", 90.0, np.maximum(hill_tops, 4.0), hills),
        )
    )


def build_world(*, seed=0, place="courtyard") -> World:
    """The courtyard of a seed (textures and ragged edges; the layout is fixed).

    place `object`: its boxes and the arm alone, before white.
    """
    rng = np.random.default_rng([seed, 0])
    pyramid = textures.pyramid
    plan = materials.ground_plan(seed)
    ground = tuple(
        (half_m, pyramid(materials.ground(half_m, *detail, plan, rng)))
        for half_m, *detail in materials.GROUND
    )
    boxes = (*make_posters(rng), *make_fixtures(rng))
    if place == "object":
        kept = [box for box in boxes if OBJECTS[box.object_id] in OF_OBJECT]
        white = pyramid(np.full((8, 8, 3), 255, np.uint8))
        return World(boxes=tuple(kept), ground=(), rings=(), sky=white)
    return World(
        boxes=boxes,
        ground=ground,
        rings=make_rings(rng),
        sky=pyramid(materials.sky((512, 4096), rng)),
    )
