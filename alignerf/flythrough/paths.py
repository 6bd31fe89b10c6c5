"""A smooth path that stays among a capture's cameras and looks where they look.

Notation: poses [n, 3, 4] camera-to-world with OpenGL axes, in the normalised frame
(`cameras.frame_of`): centred, z along the least spread, largest coordinate 1. A path
begins again where it ends, so a film of it can be repeated.
"""

import numpy as np
from scipy import interpolate
from scipy.spatial.transform import Rotation

from alignerf.flythrough import tours
from alignerf.scenes import cameras

# Of a film of 5 s; even, since half of them go there and half back.
FRAMES, FPS = 120, 24
# An ellipse reaches this percentile of the cameras' coordinates (as in mip-NeRF 360).
REACH = 90
# The least of its semi-axes to the other: a flat one is a line that is gone twice.
LEAST_ROUND = 0.2
# Where an ellipse leaves the cameras: none is so near, in semi-axes, and turned alike.
MOST_APART, MOST_TURNED_DEG = 0.4, 35.0
# Cameras of a way are averaged down to these, between which the path is cubic.
CONTROLS, DEGREE, SAMPLES = 12, 3, 1000
# More of a turn in half a film makes one giddy.
MOST_TURN_DEG = 90.0


def through(poses, count=FRAMES):
    """A closed path [count, 3, 4] through cameras: an ellipse, or there and back.

    The ellipse is for cameras that stand around what they look at, or in a plane before
    it. Cameras that do not are visited in a short order. Raises ValueError for fewer
    than two cameras.
    """
    if len(poses) < 2:
        raise ValueError("one camera makes no path")
    path = ellipse(poses, count)
    if path is not None and is_among(path, poses):
        return path
    return there_and_back(poses, count)


def ellipse(poses, count):
    """Poses on an ellipse in the cameras' plane; None where they stand in a line.

    They look at the point that all cameras look at or, where their axes do not meet,
    the way that cameras look on average.
    """
    centres = poses[:, :, 3]
    semi_axes = np.percentile(np.abs(centres[:, :2]), REACH, axis=0)
    if semi_axes.min() < max(LEAST_ROUND * semi_axes.max(), 1e-6):
        return None
    angles = 2 * np.pi * np.arange(count) / count
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1) * semi_axes
    places = np.column_stack([around, np.full(count, centres[:, 2].mean())])
    focus = meeting_point(poses)
    if focus is None:
        turn = mean_rotations(poses[:, :, :3], np.ones((1, len(poses))))
        turns = np.repeat(turn, count, axis=0)
    else:
        turns = looking_at(places, focus, poses[:, :, 1].mean(axis=0))
    return np.concatenate([turns, places[..., None]], axis=-1)


def meeting_point(poses):
    """The point [3] closest to all optical axes, if all cameras have it before them."""
    focus = cameras.focus_of(poses)
    if focus is None:
        return None
    depth = ((poses[:, :, 3] - focus) * poses[:, :, 2]).sum(axis=-1)
    return focus if depth.min() > 0 else None


def looking_at(places, target, up):
    """Rotations [n, 3, 3] of cameras at places [n, 3] that look at a point [3]."""
    back = unit(places - target)
    right = unit(np.cross(up, back))
    return np.stack([right, np.cross(back, right), back], axis=-1)


def unit(vectors):
    """Vectors [..., 3] of length 1; those of length 0 stay."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.maximum(length, 1e-12)


def is_among(path, poses):
    """Whether a path is everywhere near to a camera that is turned as it is."""
    centres, places = poses[:, :, 3], path[:, :, 3]
    apart = np.linalg.norm(places[:, None] - centres[None], axis=-1)
    near = apart < MOST_APART * np.abs(places).max()
    alike = tours.angles(path, poses) < np.radians(MOST_TURNED_DEG)
    return bool((near & alike).any(axis=1).all())


def there_and_back(poses, count):
    """Poses on a B-spline past the cameras, to its end and back.

    A B-spline stays in the hull of its control points, which are means of cameras that
    follow each other, and so do its turns. Of long ways the middle is taken, up to
    MOST_TURN_DEG.
    """
    way = poses[tours.order(poses)]
    at = np.linspace(0, 1, SAMPLES)
    path = along(way, at)
    steps = turns_between(path)
    kept = middle_of(np.degrees(np.append(0, steps.cumsum())), MOST_TURN_DEG)
    # By turns, too: some cameras stand at one place.
    moved = np.linalg.norm(np.diff(path[:, :, 3], axis=0), axis=-1)
    gone = np.append(0, (moved + tours.HALF_TURN * steps / np.pi).cumsum())[kept]
    # As a pendulum, which stands still at both ends.
    share = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(count // 2 + 1) / count)
    reached = gone[0] + share * (gone[-1] - gone[0])
    there = along(way, np.interp(reached, gone, at[kept]))
    return np.concatenate([there, there[1 : (count + 1) // 2][::-1]])


def along(way, at):
    """Poses at places from 0 to 1 of a clamped B-spline past cameras in their order."""
    parts = np.array_split(np.arange(len(way)), min(CONTROLS, len(way)))
    controls = np.zeros((len(parts), len(way)))
    for row, part in zip(controls, parts, strict=True):
        row[part] = 1 / len(part)
    degree = min(DEGREE, len(parts) - 1)
    inner = np.linspace(0, 1, len(parts) - degree + 1)
    knots = np.concatenate([[0] * degree, inner, [1] * degree])
    spline = interpolate.BSpline.design_matrix(at, knots, degree).toarray()
    weights = spline @ controls
    turns = mean_rotations(way[:, :, :3], weights)
    places = weights @ way[:, :, 3]
    return np.concatenate([turns, places[..., None]], axis=-1)


def turns_between(path):
    """Angles [n - 1] in radians between poses that follow each other."""
    turns = path[:, :, :3]
    return Rotation.from_matrix(turns[:-1].swapaxes(1, 2) @ turns[1:]).magnitude()


def middle_of(turned, most):
    """The slice in the middle of rising values [n] that spans at most so much."""
    if turned[-1] <= most:
        return slice(0, len(turned))
    first, last = np.searchsorted(turned, (turned[-1] + np.array([-most, most])) / 2)
    return slice(int(first), int(last))


def mean_rotations(rotations, weights):
    """Chordal means [m, 3, 3] of rotations [n, 3, 3] with weights [m, n]."""
    u, _, vt = np.linalg.svd(np.einsum("mn,nij->mij", weights, rotations))
    signs = np.ones((len(u), 3))
    signs[:, 2] = np.linalg.det(u @ vt)
    return (u * signs[:, None]) @ vt
