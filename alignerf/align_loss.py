"""Contribution 2: the alignment-aware loss (AligNeRF, Eq. 4).

    L_PM = min_i ( ||G_i - R||_2^2 + lambda sqrt(dx_i^2 + dy_i^2) )

Notation: R [p, p, 3] a rendered patch, G [p + 2 r, p + 2 r, 3] the photo around it,
valid [p + 2 r, p + 2 r] the pixels of G that exist; i runs over the (2 r + 1)^2
offsets (dx, dy) in pixels, G_i the p x p part of G at offset i. The squared error
is *summed* over the patch: lambda = 0.01 weighs nothing against a mean.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int


class Alignment(NamedTuple):
    """The photo patch that fits the render best."""

    patch: Float[Array, "p p 3"]
    offset_px: Int[Array, "2"]
    cost: Float[Array, ""]


def offsets_px(radius_px: int) -> np.ndarray:
    """All offsets [(2 r + 1)^2, 2] as (dx, dy), the shortest first.

    Shortest first, so that a tie goes to the smallest offset.
    """
    axis = np.arange(-radius_px, radius_px + 1)
    dy, dx = np.meshgrid(axis, axis, indexing="ij")
    offsets = np.stack([dx.ravel(), dy.ravel()], axis=-1)
    return offsets[np.argsort((offsets**2).sum(axis=-1), kind="stable")]


def align(
    render: Float[Array, "p p 3"],
    photo: Float[Array, "q q 3"],
    valid: Float[Array, "q q"],
    *,
    penalty: float = 0.01,
) -> Alignment:
    """The sub-patch of the photo with the least cost; offset 0 must be valid.

    Differences are taken directly: expanding the square loses all digits on
    bright, flat patches in float32. An offset that needs a pixel which does not
    exist costs infinity. No gradient flows: the minimum's is that of its patch.
    """
    size = render.shape[0]
    radius = (photo.shape[0] - size) // 2
    render = jax.lax.stop_gradient(render)
    candidates = jnp.asarray(offsets_px(radius))

    def cut(image, offset):
        start = (offset[1] + radius, offset[0] + radius)
        return jax.lax.dynamic_slice(
            image, (*start, *[0] * (image.ndim - 2)), (size, size, *image.shape[2:])
        )

    def cost_of(offset):
        error = jnp.sum((cut(photo, offset) - render) ** 2)
        length = jnp.sqrt(jnp.sum(offset.astype(jnp.float32) ** 2))
        exists = jnp.all(cut(valid, offset) > 0)
        return jnp.where(exists, error + penalty * length, jnp.inf)

    # One offset after the other: all patches at once are 289 copies of the photo.
    costs = jax.lax.map(cost_of, candidates)
    best = jnp.argmin(costs)
    offset = candidates[best]
    return Alignment(cut(photo, offset), offset, costs[best])
