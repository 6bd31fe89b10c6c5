"""Contribution 2 in any model: the alignment-aware loss on single rays.

    L_PM = min_i ( sum over a patch of ||G_i - R||_2^2 + lambda |d_i| )      (Eq. 4)

The paper's patch is 32 x 32 neighbours of one step: few views a step, and most pixels
seldom seen. Here a patch is a tile of a photo, its rays are those that single-ray
training draws there anyway, and its sum is gathered over steps. So sampling, schedule
and the model's own loss stay the baseline's, no second stage is needed, and a tile's
offset is found by hundreds of rays.

Notation: d_i = (dx, dy) one of the s x s offsets in px, s = 2 r + 1; costs
[tiles, s, s] running means over a tile's last rays of ||G_i - R||^2, by (dy, dx); tiles
of the training views, row by row, view by view.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from alignerf.scenes import cameras

# Of all photos, about: a step passes over the costs of all tiles, and with more of them
# the rays of each are too old.
MAX_TILES = 2048


class Tiles(NamedTuple):
    """How many tiles a photo has, [rows, columns], and how far is searched."""

    rows: int
    columns: int
    radius_px: int

    @property
    def side(self):
        """s, the offsets along an axis."""
        return 2 * self.radius_px + 1


class Batch(NamedTuple):
    """Single rays, each with its tile and with s x s pixels of its photo.

    The first five: as of `training.batches.RayBatch`. counts: one where a pixel counts.
    top, left: of the pixels around the ray, counted from it; -r but at a border.
    """

    view: Int[Array, "n"]
    rays: cameras.Rays
    jitter: Float[Array, "n rounds"]
    photo: Float[Array, "n 3"]
    weight: Float[Array, "n"]
    tile: Int[Array, "n"]
    around: Int[Array, "n s s 3"]
    counts: Int[Array, "n s s"]
    top: Int[Array, "n"]
    left: Int[Array, "n"]


def tiles_of(size, views, patch_px, radius_px) -> Tiles:
    """The tiles of a photo of `size` (height, width): about patch_px a side.

    views: how many photos there are; of many, tiles are larger. Raises ValueError where
    a photo is smaller than what is searched.
    """
    side = 2 * radius_px + 1
    if min(size) < side:
        raise ValueError(
            f"config.aligned_loss.radius_px: {radius_px} searches {side} px a side, "
            f"photos have {size[1]}x{size[0]}"
        )
    patch_px = max(patch_px, (size[0] * size[1] * views / MAX_TILES) ** 0.5)
    rows, columns = (max(1, round(length / patch_px)) for length in size)
    return Tiles(rows, columns, radius_px)


def with_photo_around(batch, views, tiles: Tiles, is_valid) -> Batch:
    """The rays of a `training.batches.RayBatch` with what is around them in `views`.

    is_valid: (views, view, y, x) -> one where a pixel counts, else zero.
    """
    _, h, w, _ = views.photos.shape
    side, y, x = tiles.side, batch.y, batch.x
    # Whole windows in the photo: rows of them are copied at once.
    top = jnp.clip(y - tiles.radius_px, 0, h - side)
    left = jnp.clip(x - tiles.radius_px, 0, w - side)

    def window(view, top, left):
        start = view, top, left, 0
        return jax.lax.dynamic_slice(views.photos, start, (1, side, side, 3))[0]

    move = jnp.arange(side)
    rows = top[:, None, None] + move[None, :, None]
    columns = left[:, None, None] + move[None, None]
    counts = is_valid(views, batch.view[:, None, None], rows, columns)
    of_view = (y * tiles.rows // h) * tiles.columns + x * tiles.columns // w
    return Batch(
        view=batch.view,
        rays=batch.rays,
        jitter=batch.jitter,
        photo=batch.photo,
        weight=batch.weight,
        tile=batch.view * tiles.rows * tiles.columns + of_view,
        around=jax.vmap(window)(batch.view, top, left),
        counts=counts.astype(jnp.uint8),
        top=top - y,
        left=left - x,
    )


def squared_errors(rgb, batch: Batch) -> Float[Array, "n s s"]:
    """||G_i - R||^2 of each ray at all offsets. Differences are taken directly.

    Channel by channel: a mean over the last axis is forty times as slow on a CPU.
    """
    photo = batch.around.astype(jnp.float32) / 255.0
    return sum((photo[..., c] - rgb[:, None, None, c]) ** 2 for c in range(3))


def searches(batch: Batch, radius_px) -> Float[Array, "n"]:
    """One where a ray's whole neighbourhood lies in the photo and counts, else zero."""
    inside = (batch.top == -radius_px) & (batch.left == -radius_px)
    whole = jnp.min(batch.counts, axis=(1, 2)) > 0
    return (inside & whole & (batch.weight > 0)).astype(jnp.float32)


def offsets_px(costs, patch_rays, penalty) -> Float[Array, "tiles 2"]:
    """(dx, dy) of least cost, to a fraction of a pixel; (0, 0) of a tile without rays.

    patch_rays: in a sum over as many rays the costs stand against the penalty, lambda.
    """
    side = costs.shape[-1]
    axis = np.arange(side) - side // 2
    length_px = np.hypot(axis[:, None], axis).astype(np.float32)[None]
    empty = jnp.max(costs, axis=(1, 2)) <= 0
    costs = patch_rays * costs + penalty * length_px
    best = jnp.argmin(costs.reshape(len(costs), -1), axis=-1)
    y, x = jnp.divmod(best, side)
    # Mirrored, an offset at the rim of the search stays there: beyond it no pixel is
    # known.
    padded = jnp.pad(costs, ((0, 0), (1, 1), (1, 1)), mode="reflect")
    each = jnp.arange(len(costs))

    def vertex(dy, dx):
        before, at, after = (
            padded[each, y + 1 + step * dy, x + 1 + step * dx] for step in (-1, 0, 1)
        )
        bend = jnp.maximum(before - 2 * at + after, 1e-12)
        return jnp.clip(0.5 * (before - after) / bend, -0.5, 0.5)

    found = jnp.stack([x + vertex(0, 1), y + vertex(1, 0)], axis=-1) - side // 2
    return jnp.where(empty[:, None], 0.0, found)


def lengths_px(offsets) -> Float[Array, "tiles"]:
    """|d|."""
    return jnp.hypot(offsets[:, 0], offsets[:, 1])


def aligned_photo(batch: Batch, moved) -> tuple[Array, Array]:
    """(photo [n, 3], weight [n]) at the rays' pixels plus their offsets [n, 2] in px.

    Between pixels by Catmull-Rom's cubic, which blurs less than a linear one. A ray
    whose aligned place lies beyond the border, or by pixels that do not count, has
    weight 0; the data term then weighs less by the share of such rays.
    """
    pixels = jnp.arange(batch.around.shape[1])[None]
    across = cubic(pixels + batch.left[:, None] - moved[:, :1])
    down = cubic(pixels + batch.top[:, None] - moved[:, 1:])
    counts = batch.counts.astype(jnp.float32)
    share = jnp.einsum("ny,nx,nyx->n", down, across, counts)
    photo = batch.around.astype(jnp.float32) / 255.0
    photo = jnp.where(batch.counts[..., None] > 0, photo, 0.0)
    photo = jnp.einsum("ny,nx,nyxc->nc", down, across, photo)
    there = share > 0.5
    photo = jnp.clip(photo / jnp.where(there, share, 1.0)[:, None], 0.0, 1.0)
    still = jnp.all(moved == 0, axis=-1)
    # To the bit what the baseline sees.
    photo = jnp.where(still[:, None], batch.photo, photo)
    return photo, batch.weight * (there | still)


def cubic(x):
    """Catmull-Rom's weights at a distance x in px."""
    x = jnp.abs(x)
    near = (1.5 * x - 2.5) * x**2 + 1
    far = ((-0.5 * x + 2.5) * x - 4) * x + 2
    return jnp.where(x < 1, near, jnp.where(x < 2, far, 0.0))


def summed(rgb, batch: Batch, tiles: Tiles, count):
    """(sums [count, s, s] of the squared errors of each tile's rays, how many [count]).

    count: of all tiles.
    """
    use = searches(batch, tiles.radius_px)
    errors = use[:, None, None] * squared_errors(rgb, batch)
    add = functools.partial(
        jax.ops.segment_sum, segment_ids=batch.tile, num_segments=count
    )
    return add(errors), add(use)


def gathering(costs, rgb, batch: Batch, tiles: Tiles):
    """A term of the loss that is 0, and whose gradient moves `costs` to the rays'.

    A step of gradient descent by `rate_of` makes each tile's costs the running mean.
    """
    found = jax.lax.stop_gradient(squared_errors(rgb, batch))
    use = searches(batch, tiles.radius_px)[:, None, None]
    distance = jnp.sum(use * (costs[batch.tile] - found) ** 2, axis=(1, 2))
    value = 0.5 * jnp.mean(distance)
    return value - jax.lax.stop_gradient(value)


def rate_of(batch_rays, count, patch_rays) -> float:
    """The rate at which costs follow: a mean over a tile's last `patch_rays` rays.

    A step's gradient is a mean over all its rays. Where a step brings a tile more than
    these on average, costs are about the mean over that step's. count: of all tiles.
    """
    return batch_rays / max(patch_rays, batch_rays / count)
