"""Contribution 2: the alignment-aware loss (AligNeRF, Eq. 4).

    L_PM = min_i ( ||G_i - R||_2^2 + lambda sqrt(dx_i^2 + dy_i^2) )

Notation: R [p, p, 3] a rendered patch, G [q, q, 3], q = p + 2 r, the photo around it,
valid [q, q] above zero where a pixel of G counts; i runs over the s^2 offsets
(dx, dy) in pixels, s = 2 r + 1, G_i the p x p part of G at offset i. The squared
error is *summed* over the patch, as printed. At 25 dB the sum over 16 px is 2.4: with
lambda = 0.01 an offset of 8 px costs 3 % of it, so lambda decides among ties. Against
a mean (0.003) one pixel would cost three times the error, and nothing would move.
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
    # Of the squared error: pixels that count at offset 0 / at this one.
    scale: Float[Array, ""]


def offsets_px(radius_px: int) -> np.ndarray:
    """All offsets [s^2, 2] as (dx, dy), the shortest first.

    Shortest first, so that a tie goes to the smallest offset.
    """
    axis = np.arange(-radius_px, radius_px + 1)
    dy, dx = np.meshgrid(axis, axis, indexing="ij")
    offsets = np.stack([dx.ravel(), dy.ravel()], axis=-1)
    return offsets[np.argsort((offsets**2).sum(axis=-1), kind="stable")]


def radius_of(render, photo) -> int:
    """r of two patches; ValueError where q is no p + 2 r."""
    radius, odd = divmod(len(photo) - len(render), 2)
    if odd or radius < 0:
        raise ValueError(
            f"{len(photo)} px of photo are not a render's {len(render)} px and as many "
            "more on each side"
        )
    return radius


def align(
    render: Float[Array, "p p 3"],
    photo: Float[Array, "q q 3"],
    valid: Float[Array, "q q"],
    *,
    penalty: float = 0.01,
) -> Alignment:
    """The sub-patch of the photo with the least cost, lambda = penalty.

    Only offsets that see as many pixels that count as offset 0 does, or more, are
    looked at: at a photo's border none reaches beyond it. With holes in the middle
    the squared error is scaled to as many pixels as count at offset 0, and the patch
    shows the render where a pixel does not count, so that no loss sees one. No
    gradient flows: the minimum's is that of its patch. Raises ValueError where q is
    no p + 2 r.
    """
    size, radius = len(render), radius_of(render, photo)
    render, photo = jax.lax.stop_gradient((render, photo))
    counts = valid > 0
    photo = jnp.where(counts[..., None], photo, jnp.inf)
    seen = window_sums(counts.astype(jnp.float32), size)
    error = squared_errors(render, photo)
    wanted = seen[radius, radius]
    scale = wanted / jnp.maximum(seen, 1.0)
    error = jnp.where(seen >= wanted, error * scale, jnp.inf)
    offsets = offsets_px(radius)
    dx, dy = (offsets + radius).T
    length_px = np.linalg.norm(offsets, axis=-1).astype(np.float32)
    costs = error[dy, dx] + penalty * length_px
    best = jnp.argmin(costs)
    offset = jnp.asarray(offsets)[best]
    y, x = offset[1] + radius, offset[0] + radius
    patch = jax.lax.dynamic_slice(photo, (y, x, 0), render.shape)
    patch = jnp.where(patch < jnp.inf, patch, render)
    return Alignment(patch, offset, costs[best], scale[dy, dx][best])


def squared_errors(
    render: Float[Array, "p p 3"], photo: Float[Array, "q q 3"]
) -> Float[Array, "s s"]:
    """||G_i - R||_2^2 by (dy, dx); pixels of the photo that are infinite add nothing.

    Differences are taken directly: expanding the square loses all digits on bright,
    flat patches in float32. One row of the render after the other, for all offsets
    at once and into a sum for each column: no term takes part in more than 4 p
    roundings (8e-6 at p = 32), and the photo is copied s times, not s^2 times.
    """
    size, side = len(render), len(photo) - len(render) + 1
    rows = photo.reshape(len(photo), -1)
    # What each dx sees of each row [q, s, 3 p].
    rows = jnp.stack([rows[:, 3 * dx : 3 * (dx + size)] for dx in range(side)], axis=1)
    render = render.reshape(size, -1)

    def add_row(y, total):
        photo = jax.lax.dynamic_slice_in_dim(rows, y, side)
        return total + jnp.where(
            photo < jnp.inf, (photo - render[y][None, None]) ** 2, 0.0
        )

    total = jnp.zeros((side, side, 3 * size))
    return jnp.sum(jax.lax.fori_loop(0, size, add_row, total, unroll=4), axis=-1)


def window_sums(x: Float[Array, "q q"], size: int) -> Float[Array, "s s"]:
    """Sums of all windows of size x size; exact where x is 0 or 1."""
    after = np.arange(len(x)) - np.arange(len(x) - size + 1)[:, None]
    inside = ((after >= 0) & (after < size)).astype(np.float32)
    return inside @ x @ inside.T
