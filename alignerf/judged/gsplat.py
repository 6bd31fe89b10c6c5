"""The world of gsplat's `simple_trainer`, which normalizes a COLMAP project.

`normalize_world_space` is its default, and its .ply does not say it (gsplat,
examples/datasets/normalize.py and colmap.py). The similarity follows from all cameras
and points of the model: the mean up axis of the cameras becomes -y, the median of what
they look at the origin, their median distance 1; then the points' median becomes the
origin, and their principal axes x, y, z.

Notation: poses camera-to-world [n, 3, 4], OpenGL axes; points [m, 3]; worlds [4, 4].
"""

import numpy as np

NAME = "that of gsplat, normalized"
# Eigenvectors have no sign, and versions differ in what they turn upside down.
HALF_TURNS = {
    NAME: (1, 1, 1),
    f"{NAME}, turned about x": (1, -1, -1),
    f"{NAME}, turned about y": (-1, 1, -1),
    f"{NAME}, turned about z": (-1, -1, 1),
}


def worlds(poses, points):
    """{name: world} of those that gsplat may have made of cameras; {} of few points."""
    poses, points = np.asarray(poses), np.asarray(points)
    if len(points) < 4 or not np.isfinite(points).all():
        return {}
    turn = to_minus_y(poses[:, :, 1].mean(axis=0))
    at, ahead = (turn @ column for column in (poses[:, :, 3].T, -poses[:, :, 2].T))
    # Where each camera's axis comes nearest to the origin.
    middle = np.median(at - (at * ahead).sum(axis=0) * ahead, axis=1)
    away = np.median(np.linalg.norm(at - middle[:, None], axis=0))
    if not away > 0:
        return {}
    placed = (points @ turn.T - middle) / away
    centroid = np.median(placed, axis=0)
    axes = np.linalg.eigh(np.cov(placed, rowvar=False))[1][:, ::-1]
    axes = axes * [np.sign(np.linalg.det(axes)), 1, 1]
    found = {}
    for name, signs in HALF_TURNS.items():
        world, turned = np.eye(4), np.diag(signs) @ axes.T
        world[:3, :3] = turned @ turn / away
        world[:3, 3] = -turned @ (middle / away + centroid)
        found[name] = world
    return found


def to_minus_y(up):
    """The rotation [3, 3] by the smallest angle that takes a direction to -y."""
    up = up / np.linalg.norm(up)
    x, _, z = np.cross(up, [0, -1, 0])
    skew = np.array([[0, -z, 0], [z, 0, -x], [0, x, 0]])
    # Of +y itself the numerator is 0.
    return np.eye(3) + skew + skew @ skew / max(1 - up[1], 1e-12)
