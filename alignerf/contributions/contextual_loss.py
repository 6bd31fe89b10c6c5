"""A loss that aligns each pixel by itself: what AligNeRF sets its Eq. 4 against.

The contextual bilateral loss (Zhang et al., CVPR 2019, arXiv 1905.05169, Eq. 3)

    CoBi = 1/N sum_i min_j ( D(R_i, G_j) + w_s |x_i - x_j| )

on colours: D is the mean squared distance of the RGB values of two windows of k x k
pixels. It was published with the cosine distance, which is blind to brightness and has
no value on black, of windows and of VGG features, and with a search in the whole image.

Notation: R [p, p, 3] a rendered patch, G [q, q, 3], q = p + 2 r, the photo around it,
valid [q, q] above zero where a pixel of G counts. Pixel i of R at x_i is matched with
pixel j of G at x_j = x_i + (dx, dy), |dx| and |dy| at most r. Of a window count the
pixels that are in R's patch and whose partners in G are valid.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from alignerf.contributions import align_loss


class Matching(NamedTuple):
    """The photo's pixels that fit the render's best, each by itself."""

    patch: Float[Array, "p p 3"]
    offset_px: Int[Array, "p p 2"]
    loss: Float[Array, ""]


def match(
    render: Float[Array, "p p 3"],
    photo: Float[Array, "q q 3"],
    valid: Float[Array, "q q"],
    *,
    window_px: int = 3,
    spatial_weight: float = 0.001,
) -> Matching:
    """Match each pixel, k = window_px, w_s = spatial_weight in squared colour a pixel.

    Ties go to the smallest offset. N counts the pixels of the render with a valid
    pixel within r; the others have no part in the loss, and the patch shows the
    render there. The gradient flows through the render alone, and only through the
    distances of the best matches. Raises ValueError where k is even or q no p + 2 r.
    """
    if window_px % 2 == 0:
        raise ValueError(f"window_px: must be odd, not {window_px}")
    radius = align_loss.radius_of(render, photo)
    photo, counts = jax.lax.stop_gradient(photo), valid > 0
    photo = jnp.where(counts[..., None], photo, 0.0)
    offset, matched = search(
        jax.lax.stop_gradient(render), photo, counts, window_px, spatial_weight
    )
    axis = jnp.arange(len(render))
    row = axis[:, None] + radius + offset[..., 1]
    column = axis[None, :] + radius + offset[..., 0]
    distance = distance_at(render, photo, counts, offset, window_px)
    length = jnp.sqrt(jnp.sum(offset.astype(jnp.float32) ** 2, axis=-1))
    cost = jnp.where(matched, distance + spatial_weight * length, 0.0)
    return Matching(
        jnp.where(
            matched[..., None], photo[row, column], jax.lax.stop_gradient(render)
        ),
        offset,
        jnp.sum(cost) / jnp.maximum(jnp.sum(matched), 1),
    )


def search(
    render, photo, counts, window_px, spatial_weight
) -> tuple[Int[Array, "p p 2"], Bool[Array, "p p"]]:
    """The offset (dx, dy) of each pixel's best match, and whether there is any."""
    size, radius = len(render), align_loss.radius_of(render, photo)
    offsets = align_loss.offsets_px(radius)
    length_px = np.linalg.norm(offsets, axis=-1).astype(np.float32)
    offsets, penalties = jnp.asarray(offsets), spatial_weight * jnp.asarray(length_px)

    def look(i, best_so_far):
        least, best = best_so_far
        start = (offsets[i, 1] + radius, offsets[i, 0] + radius)
        part = jax.lax.dynamic_slice(photo, (*start, 0), render.shape)
        count = jax.lax.dynamic_slice(counts, start, (size, size))
        squared = jnp.where(count, jnp.sum((part - render) ** 2, axis=-1), 0.0)
        sums = window_sums(jnp.stack([squared, count.astype(jnp.float32)]), window_px)
        cost = sums[0] / jnp.maximum(sums[1], 1.0) + penalties[i]
        # Offsets come in the order of their length: a later equal is not taken.
        better = count & (cost < least)
        return jnp.where(better, cost, least), jnp.where(better, i, best)

    start = (jnp.full((size, size), jnp.inf), jnp.zeros((size, size), jnp.int32))
    least, best = jax.lax.fori_loop(0, len(offsets), look, start)
    return offsets[best], least < jnp.inf


def window_sums(x: Float[Array, "n p p"], window_px: int) -> Float[Array, "n p p"]:
    """Sums over k x k pixels around each; what lies beyond the border is zero."""
    size, reach = x.shape[-1], window_px // 2
    for axis in (1, 2):
        padding = [(reach, reach) if i == axis else (0, 0) for i in range(3)]
        wide = jnp.pad(x, padding)
        x = sum(
            jax.lax.slice_in_dim(wide, k, k + size, axis=axis) for k in range(window_px)
        )
    return x


def distance_at(
    render, photo, counts, offset: Int[Array, "p p 2"], window_px
) -> Float[Array, "p p"]:
    """D of each pixel's window with the one at the pixel's own offset."""
    size, radius = len(render), align_loss.radius_of(render, photo)
    row, column = np.mgrid[:size, :size]
    total = count = jnp.zeros((size, size))
    for dy, dx in np.ndindex(window_px, window_px):
        y, x = row + dy - window_px // 2, column + dx - window_px // 2
        inside = (y == np.clip(y, 0, size - 1)) & (x == np.clip(x, 0, size - 1))
        y, x = np.clip(y, 0, size - 1), np.clip(x, 0, size - 1)
        partner = (y + radius + offset[..., 1], x + radius + offset[..., 0])
        counted = jnp.where(inside & counts[partner], 1.0, 0.0)
        squared = jnp.sum((photo[partner] - render[y, x]) ** 2, axis=-1)
        total, count = total + counted * squared, count + counted
    return total / jnp.maximum(count, 1.0)
