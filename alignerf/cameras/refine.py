"""Poses optimized with the scene: the alternative to cameras corrected by flow.

`refined` wraps a method: each training view gets a turn and a step, learnt from the
colours of its rays as in BARF (arXiv 2104.06405) and CamP (arXiv 2308.10902). Renders
are those of the wrapped method; `learnt` gives the cameras that go with them.

Notation: twist [views, 6] = (turn w, a rotation vector; step v), both along the axes of
the normalised scene: a ray's direction d becomes R(w) d, its origin o + v.
"""

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from scipy.spatial.transform import Rotation

from alignerf.cameras import moves
from alignerf.scenes import cameras, prepared

# CamP's constants: points seen by a camera, between these depths in units of the
# normalised scene, say how far a twist moves its pixels; the diagonal is padded by so
# much of itself, and a little more.
POINTS, NEAR, FAR = 1000, 0.4, 1000.0
PAD, LEAST = 0.1, 1e-8
# Below this angle in radians squared, sin(x) / x is its series.
SMALL = 1e-6


class Views(NamedTuple):
    """The cameras of the training views, in the normalised frame."""

    pixtocams: np.ndarray  # [views, 3, 3]
    camtoworlds: np.ndarray  # [views, 3, 4]
    size: tuple[int, int]  # width, height


def views_of(loaded: prepared.Scene) -> Views:
    """The cameras that a method may learn."""
    chosen = loaded.views("train")
    size = loaded.width, loaded.height
    return Views(loaded.pixtocams[chosen], loaded.camtoworlds[chosen], size)


def scales_of(views: Views, preconditioned):
    """Matrices [views, 6, 6] that map the learnt parameters to twists."""
    if preconditioned:
        return preconditioners(*views)
    return np.broadcast_to(np.eye(6), (len(views.pixtocams), 6, 6))


def refined(method, scales, *, prior_weight=0.0, learning=True):
    """The `methods.Method` with cameras of its own; scales as of `scales_of`.

    Its parameters `cameras` [views, 6] are zero at first. Twists are scales times them.
    The mean of their squares times prior_weight is a term of the loss: what photos show
    only weakly, as a bend of all cameras, stays as it was given, and what they do not
    show at all. learning: False leaves the cameras as they are, at no cost.
    """
    scales = np.asarray(scales, np.float32)

    def init(key):
        return {**method.init(key), "cameras": jnp.zeros(scales.shape[:2])}

    def terms(params, batch, share):
        own = {name: tree for name, tree in params.items() if name != "cameras"}
        if not learning:
            return method.terms(own, batch, share)
        moved = twists(params["cameras"], scales)[batch.view]
        batch = batch._replace(rays=move(batch.rays, moved))
        losses, shown = method.terms(own, batch, share)
        prior = prior_weight * jnp.mean(jnp.sum(params["cameras"] ** 2, axis=-1))
        return {**losses, "cameras": prior}, shown

    return method._replace(init=init, terms=terms)


def twists(params, scales):
    """Twists [views, 6] of the learnt parameters [views, 6]."""
    return jnp.sum(jnp.asarray(scales) * params[:, None, :], axis=-1)


def move(rays: cameras.Rays, twist) -> cameras.Rays:
    """Rays [n], each moved by its camera's twist [n, 6]. The cone's radius stays."""
    turn, step = twist[:, :3], twist[:, 3:]
    return rays._replace(
        origins=rays.origins + step,
        directions=rotated(rays.directions, turn),
        viewdirs=rotated(rays.viewdirs, turn),
    )


def rotated(vectors, turn):
    """Vectors [n, 3] turned by rotation vectors [n, 3] (Rodrigues); smooth at zero."""
    square = jnp.sum(turn**2, axis=-1, keepdims=True)
    small = square < SMALL
    # Where the series serves, the other branch must not divide by zero either.
    angle = jnp.sqrt(jnp.where(small, 1.0, square))
    first = jnp.where(small, 1.0 - square / 6.0, jnp.sin(angle) / angle)
    half = jnp.sin(0.5 * angle) / angle
    second = jnp.where(small, 0.5 - square / 24.0, 2.0 * half**2)
    across = jnp.cross(turn, vectors)
    return vectors + first * across + second * jnp.cross(turn, across)


def preconditioners(pixtocams, camtoworlds, size, *, seed=0):
    """[views, 6, 6] that make a unit of a parameter move pixels by 1 px (CamP, Eq. 8).

    Root mean square over the pixels of points that a camera of `size` (width, height)
    sees: the inverse square root of J^T J, J their derivative by its twist. So one
    learning rate suits short and long lenses, small photos and large ones.
    """
    rng = np.random.default_rng(seed)
    at = rng.uniform(size=(POINTS, 2)) * size
    # Evenly in 1 / depth, as the scene's samples are.
    depth = 1 / rng.uniform(1 / FAR, 1 / NEAR, size=(POINTS, 1))
    roots = []
    for pixtocam, pose in zip(pixtocams, camtoworlds, strict=True):
        rays = np.concatenate([at, np.ones((POINTS, 1))], axis=-1) @ pixtocam.T
        jacobian = pixel_jacobian(depth * rays, pixtocam, pose)
        square = jacobian.T @ jacobian / POINTS
        square += np.diag(PAD * np.diag(square) + LEAST)
        values, vectors = np.linalg.eigh(square)
        roots.append(vectors @ np.diag(values**-0.5) @ vectors.T)
    return np.stack(roots)


def pixel_jacobian(points, pixtocam, pose):
    """[2 n, 6]: how a camera's pixels move by its twist.

    points [n, 3]: what they show, in the camera's OpenCV axes. A camera that turns by w
    sees them turned by -w.
    """
    axes = pose[:, :3] @ cameras.OPENGL_FROM_OPENCV
    x, y, z = points.T
    focal = np.linalg.inv(pixtocam)[:2, :2]
    none = np.zeros_like(x)
    image = np.stack([1 / z, none, -x / z**2, none, 1 / z, -y / z**2], axis=-1)
    image = focal @ image.reshape(-1, 2, 3)
    # d point = point x w' - v', with w' and v' along the camera's axes.
    cross = np.stack([none, -z, y, z, none, -x, -y, x, none], axis=-1)
    step = np.broadcast_to(-np.eye(3), (len(x), 3, 3))
    moved = np.concatenate([cross.reshape(-1, 3, 3), step], axis=-1)
    turned = np.kron(np.eye(2), axes.T)
    return (image @ moved).reshape(-1, 6) @ turned


def learnt(loaded: prepared.Scene, params, scales) -> prepared.Scene:
    """The scene with the learnt poses, all views in the frame of the learnt ones.

    params [views, 6]: the learnt parameters of the training views; scales as of
    `scales_of`. A similarity that all learnt poses share is no error, since no photo
    shows it. So the other views are moved by what the moves of the training views have
    in common.
    """
    params, chosen = np.asarray(params), loaded.views("train")
    if not params.any():
        return loaded
    given = loaded.camtoworlds[chosen]
    moved = moved_cameras(given, twists(params, scales))
    similarity = moves.in_common(given, moved)
    poses = cameras.apply_similarity(loaded.camtoworlds, *similarity)
    poses[chosen] = moved
    return dataclasses.replace(loaded, camtoworlds=poses)


def moved_cameras(camtoworlds, twist):
    """Poses [n, 3, 4] after twists [n, 6] of `refined`."""
    poses, twist = np.array(camtoworlds, np.float64), np.asarray(twist, np.float64)
    turn = Rotation.from_rotvec(twist[:, :3]).as_matrix()
    poses[:, :, :3] = turn @ poses[:, :, :3]
    poses[:, :, 3] += twist[:, 3:]
    return poses
