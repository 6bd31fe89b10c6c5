"""How a system bounds space, besides mip-NeRF 360's contraction.

Notation: o, d [..., 3] a ray's origin and direction, of any length; x = o + t d.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

TINY = 1e-12


def sphere_exit(
    origins: Float[Array, "*batch 3"],
    directions: Float[Array, "*batch 3"],
    radius: float,
) -> Float[Array, "*batch 1"]:
    """The t at which rays that begin inside a sphere about 0 leave it.

    For an origin outside, the nearest point of the ray to the sphere's middle counts as
    inside: t is where it passes that.
    """
    square, middle, rest = _quadratic(origins / radius, directions / radius)
    # Not of zero: the root's derivative there is none.
    root = jnp.sqrt(jnp.maximum(middle**2 + square * (1.0 - rest), TINY))
    return jnp.maximum((root - middle) / square, 0.0)


def invert_sphere(
    inverse_radius: Float[Array, "*batch n"],
    origins: Float[Array, "*batch 3"],
    directions: Float[Array, "*batch 3"],
) -> Float[Array, "*batch n 4"]:
    """(x / |x|, 1 / |x|) of the points of rays outside the unit sphere (NeRF++, 4).

    inverse_radius in [0, 1] says how far out: 1 / |x|. Rays begin inside the sphere.
    The point is not formed: |x| may be infinite. With u = 1 / |x| and x = o + t d, the
    direction x / |x| is u o + (u t) d, and u t solves |u o + (u t) d| = 1.
    """
    square, middle, rest = (
        part[..., None, :] for part in _quadratic(origins, directions)
    )
    u = inverse_radius[..., None]
    root = jnp.sqrt(jnp.maximum((u * middle) ** 2 + square * (1.0 - u**2 * rest), TINY))
    ut = (root - u * middle) / square
    x = u * origins[..., None, :] + ut * directions[..., None, :]
    # Where the ray passes outside the sphere, it is its nearest direction.
    unit = x / jnp.sqrt(jnp.maximum(jnp.sum(x**2, axis=-1, keepdims=True), TINY))
    return jnp.concatenate([unit, jnp.broadcast_to(u, (*x.shape[:-1], 1))], axis=-1)


def _quadratic(origins, directions):
    """|d|^2, o . d and |o|^2, each [..., 1]."""
    square = jnp.sum(directions**2, axis=-1, keepdims=True)
    middle = jnp.sum(origins * directions, axis=-1, keepdims=True)
    return square, middle, jnp.sum(origins**2, axis=-1, keepdims=True)


def in_box(
    x: Float[Array, "*batch 3"], side: float
) -> tuple[Float[Array, "*batch 3"], Float[Array, "*batch"]]:
    """(x from [-side/2, side/2] to [0, 1], whether it lies in the box, 1 or 0).

    What lies outside is moved onto the box's rim, so that a lookup stays in range.
    """
    at = x / side + 0.5
    inside = jnp.all((at >= 0.0) & (at <= 1.0), axis=-1)
    return jnp.clip(at, 0.0, 1.0), inside.astype(x.dtype)
