"""The flow of a camera that is moved a little: exact, and its derivative.

Notation: a pixel's ray d [..., 3] = pixtocam (x + .5, y + .5, 1), of depth 1; its
point d / rho with `rho` = 1 / depth along the optical axis, so that infinitely far is
rho = 0. The moved camera, in the frame of the first (x right, y down, z forwards), is
turned by R, has its centre at c and a focal length e^s times as long. It sees the
point along q = R^T (d - rho c), at the pixel K (e^s q_x / q_z, e^s q_y / q_z, 1) with
K = pixtocam^-1. For small motions: Longuet-Higgins and Prazdny 1980.
"""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

# Points nearer than this share of their depth to the moved camera's plane have left
# its view; without a bound they would be anywhere.
MIN_Q_Z = 0.05
MIN_DEPTH = 1e-12
# Axes of poses (x right, y up, z backwards) from those of a motion, and back.
OPENGL = np.diag([1.0, -1.0, -1.0])


class Motion(NamedTuple):
    """A camera in the frame of another one; all zero: the same camera."""

    rotation: np.ndarray  # [3] rotation vector in radians
    centre: np.ndarray  # [3] in units of the depth
    log_focal: float  # logarithm of its focal length over the other's


STILL = Motion(np.zeros(3), np.zeros(3), 0.0)


class Points(NamedTuple):
    """Where pixels [...] look, and how far, by a camera with K = camtopix."""

    rays: np.ndarray  # [..., 3]
    rho: np.ndarray  # [...]
    camtopix: np.ndarray  # [3, 3]


def points_of(pixtocam, depth) -> Points:
    """Points of all pixels of a depth map [h, w]; unknown depths count as far away."""
    depth = np.asarray(depth, dtype=np.float64)
    rho = 1 / np.where(depth > 0, np.maximum(depth, MIN_DEPTH), np.inf)
    y, x = np.indices(depth.shape) + 0.5
    pixels = np.stack([x, y, np.ones(depth.shape)], axis=-1)
    rays = pixels @ np.asarray(pixtocam, dtype=np.float64).T
    return Points(rays / rays[..., 2:], rho, np.linalg.inv(pixtocam))


def flow(motion: Motion, points: Points):
    """The flow [..., 2] in px that the motion of the camera causes.

    The difference to the same formula without motion, so that no motion gives zero.
    """
    return pixels(motion, points) - pixels(STILL, points)


def jacobian(motion: Motion, points: Points, q=None):
    """Derivative [n, 2, 7] of `flow` by a further turn, step and zoom (see `moved`).

    In the moved camera's axes: dq = q x turn - rho step. q: `directions`, where they
    are known.
    """
    q = directions(motion, points) if q is None else q
    z = q[:, 2]
    u, v, near = q[:, 0] / z, q[:, 1] / z, points.rho / z
    by = np.zeros((len(q), 2, 7))
    # Of the image (u, v) = (q_x, q_y) / q_z, so of d(u) = (dq_x - u dq_z) / q_z.
    by[:, 0, 0] = u * v
    by[:, 0, 1] = -1 - u**2
    by[:, 0, 2] = v
    by[:, 1, 0] = 1 + v**2
    by[:, 1, 1] = -u * v
    by[:, 1, 2] = -u
    by[:, 0, 3] = by[:, 1, 4] = -near
    by[:, 0, 5] = near * u
    by[:, 1, 5] = near * v
    by[:, 0, 6] = u
    by[:, 1, 6] = v
    return np.exp(motion.log_focal) * points.camtopix[:2, :2] @ by


def parameters(motion: Motion):
    """[7]: turn, centre along the turned axes, zoom, as `moved` counts from STILL."""
    centre = Rotation.from_rotvec(motion.rotation).inv().apply(motion.centre)
    return np.concatenate([motion.rotation, centre, [motion.log_focal]])


def moved(motion: Motion, change) -> Motion:
    """The motion after a further turn, a step along the turned axes, and a zoom [7]."""
    turn = Rotation.from_rotvec(motion.rotation)
    return Motion(
        rotation=(turn * Rotation.from_rotvec(change[:3])).as_rotvec(),
        centre=motion.centre + turn.apply(change[3:6]),
        log_focal=float(motion.log_focal + change[6]),
    )


def apply(motion: Motion, pixtocam, camtoworld):
    """(pixtocam [3, 3], camtoworld [3, 4]) of the moved camera.

    camtoworld has OpenGL axes, and its unit of length is that of the depth.
    """
    turn = OPENGL @ Rotation.from_rotvec(motion.rotation).as_matrix() @ OPENGL
    moved = np.array(camtoworld, dtype=np.float64)
    moved[:, :3] = camtoworld[:, :3] @ turn
    moved[:, 3] += camtoworld[:, :3] @ (OPENGL @ motion.centre)
    zoom = np.exp(-motion.log_focal)
    return np.diag([zoom, zoom, 1.0]) @ pixtocam, moved


def between(first, second) -> Motion:
    """The motion that takes one camera, (pixtocam, camtoworld), to another.

    Their focal lengths may differ, not their principal points.
    """
    (pixtocam, camtoworld), (other_pixtocam, other) = first, second
    axes = camtoworld[:, :3] @ OPENGL
    turn = axes.T @ other[:, :3] @ OPENGL
    return Motion(
        rotation=Rotation.from_matrix(turn).as_rotvec(),
        centre=axes.T @ (other[:, 3] - camtoworld[:, 3]),
        log_focal=float(np.log(pixtocam[0, 0] / other_pixtocam[0, 0])),
    )


def directions(motion, points):
    """q [..., 3] of the module's notation, kept in front of the moved camera."""
    q = points.rays - points.rho[..., None] * motion.centre
    q = q @ Rotation.from_rotvec(motion.rotation).as_matrix()
    return np.concatenate([q[..., :2], np.maximum(q[..., 2:], MIN_Q_Z)], axis=-1)


def pixels(motion, points, q=None):
    """Pixel positions [..., 2] seen by the moved camera; q: as of `jacobian`."""
    q = directions(motion, points) if q is None else q
    image = np.exp(motion.log_focal) * q[..., :2] / q[..., 2:]
    return image @ points.camtopix[:2, :2].T + points.camtopix[:2, 2]
