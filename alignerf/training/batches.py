"""The batches of a training: rays, or patches of rays, drawn from the views.

All random numbers of a step are drawn here, with its batch.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.scenes import cameras, prepared

# Rounds of the Feistel network, two additions each: after two, pixels of a step are
# spread evenly; one more is cheap.
SHUFFLES = 3


class Views(NamedTuple):
    """Training views in memory."""

    photos: Any  # [n, h, w, 3] uint8
    valid: Any  # [n, h, ceil(w / 8)] uint8, from pack_valid
    pixtocams: Any  # [n, 3, 3]
    camtoworlds: Any  # [n, 3, 4]


class RayBatch(NamedTuple):
    """Single rays; the weights are 1 on average, or all 0."""

    view: Any  # [n]
    rays: Any  # cameras.Rays [n]
    jitter: Any  # [n, rounds] of the samples, in [0, 1)
    photo: Any  # [n, 3]
    weight: Any  # [n]
    x: Any  # [n], the pixel's column
    y: Any  # [n], its row


class Patches(NamedTuple):
    """What the patches of a step are like.

    side_px: p rays along each side. radius_px: of the search around them.
    """

    count: int
    side_px: int
    radius_px: int


class PatchBatch(NamedTuple):
    """Square patches of p x p rays in the middle of q x q pixels of a photo."""

    view: Any  # [n]
    rays: Any  # cameras.Rays [n, p p]
    jitter: Any  # [n, p p, rounds]
    photo: Any  # [n, q, q, 3]
    exists: Any  # [n, q, q], zero beyond the photo's border and where it is not valid


def pack_valid(mask):
    """Bits [..., h, ceil(w / 8)] of a mask [..., h, w]: 1/24 of its photo's size."""
    return np.packbits(mask, axis=-1)


def unpack_valid(bits, w):
    """The mask [..., h, w] of such bits."""
    return np.unpackbits(np.asarray(bits), axis=-1, count=w).astype(bool)


def all_valid(n, h, w):
    """`pack_valid` of n photos in which every pixel counts.

    A training without masks has this one, so that all rounds share a compiled program.
    """
    return np.full((n, h, -(-w // 8)), 255, np.uint8)


def view_shapes(loaded: prepared.Scene, chosen) -> Views:
    """Shapes of the training views, before they are loaded."""
    n, h, w = len(chosen), loaded.height, loaded.width
    return Views(
        photos=jax.ShapeDtypeStruct((n, h, w, 3), np.uint8),
        valid=jax.ShapeDtypeStruct((n, h, -(-w // 8)), np.uint8),
        pixtocams=jax.ShapeDtypeStruct((n, 3, 3), np.float32),
        camtoworlds=jax.ShapeDtypeStruct((n, 3, 4), np.float32),
    )


def load_views(loaded: prepared.Scene, chosen, photos, valid=None) -> Views:
    """The training views in the host's memory, with the masks of the valid pixels.

    Raises ValueError where no pixel of all views is valid: the losses on the samples
    alone would move the field.
    """
    packed = [all_valid(len(chosen), loaded.height, loaded.width)]
    if valid or (loaded.folder / prepared.MASKS).is_dir():
        # View by view: masks of all photos are a third of their size.
        packed = []
        for view in chosen:
            mask = prepared.read_masks(loaded, [view])
            if valid:
                mask &= prepared.read_validity(loaded, [view], valid)
            packed.append(pack_valid(mask))
    bits = np.concatenate(packed)
    if not bits.any():
        raise ValueError(f"{valid or loaded.folder / prepared.MASKS}: no valid pixel")
    return Views(
        photos=prepared.read_images(loaded, chosen, photos),
        valid=bits,
        pixtocams=loaded.pixtocams[chosen].astype(np.float32),
        camtoworlds=loaded.camtoworlds[chosen].astype(np.float32),
    )


def is_valid(views: Views, view, y, x):
    """One where a pixel counts, else zero, as float32."""
    bits = views.valid[view, y, x // 8] >> (7 - x % 8).astype(jnp.uint8)
    return (bits & 1).astype(jnp.float32)


def draw_rays(key, step, views: Views, count, rounds) -> RayBatch:
    """The pixels of a step, from all views: no pixel comes twice before all have come.

    `key` is the training's; with `step`, from 0, it decides all that is drawn.
    """
    n, h, w, _ = views.photos.shape
    row, x = shuffled_pixels(key, step, n * h, w, count)
    view, y = row // h, row % h
    weight = is_valid(views, view, y, x)
    key_jitter = jax.random.fold_in(key, step)
    return RayBatch(
        view=view,
        rays=cameras.pixels_to_rays(
            x, y, views.pixtocams[view], views.camtoworlds[view]
        ),
        jitter=jax.random.uniform(key_jitter, (count, rounds)),
        photo=views.photos[view, y, x].astype(jnp.float32) / 255.0,
        weight=weight / jnp.maximum(jnp.mean(weight), 1e-6),
        x=x,
        y=y,
    )


def shuffled_pixels(key, step, rows, columns, count):
    """(row [count], column [count]) of step's share of all pixels in a random order.

    Every pass over the pixels has an order of its own; the pixels left at its end,
    fewer than `count`, are skipped. Nothing is stored: place i of the order is found
    by a Feistel network on (row, column), which is a bijection whatever it adds.
    """
    # Places are 32-bit numbers: of more pixels than that, each pass sees a part.
    steps_a_pass = max(1, min(rows * columns, 2**31) // count)
    words = jax.random.bits(
        jax.random.fold_in(key, step // steps_a_pass), (SHUFFLES, 2), jnp.uint32
    )
    place = (step % steps_a_pass) * count + jnp.arange(count)
    place = place.astype(jnp.uint32)
    row, column = place // columns % rows, place % columns
    for of_row, of_column in words:
        row = (row + scrambled(column ^ of_row) % rows) % rows
        column = (column + scrambled(row ^ of_column) % columns) % columns
    return row.astype(jnp.int32), column.astype(jnp.int32)


def scrambled(x):
    """A hash of 32-bit numbers (the finaliser of MurmurHash3)."""
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        x = (x ^ (x >> shift)) * jnp.uint32(factor)
    return x ^ (x >> 16)


def draw_patches(key, step, views: Views, patches: Patches, rounds) -> PatchBatch:
    """Patches drawn uniformly from all views."""
    n, h, w, _ = views.photos.shape
    count, size, radius = patches
    key_view, key_y, key_x, key_jitter = jax.random.split(
        jax.random.fold_in(key, step), 4
    )
    view = jax.random.randint(key_view, (count,), 0, n)
    top = jax.random.randint(key_y, (count,), 0, h - size + 1)
    left = jax.random.randint(key_x, (count,), 0, w - size + 1)
    inner, outer = jnp.arange(size), jnp.arange(-radius, size + radius)
    y = top[:, None, None] + inner[None, :, None]
    x = left[:, None, None] + inner[None, None, :]
    y, x = jnp.broadcast_arrays(y, x)
    rows = top[:, None, None] + outer[None, :, None]
    columns = left[:, None, None] + outer[None, None, :]
    camera = views.pixtocams[view][:, None], views.camtoworlds[view][:, None]
    rays = cameras.pixels_to_rays(x.reshape(count, -1), y.reshape(count, -1), *camera)
    exists = (rows >= 0) & (rows < h) & (columns >= 0) & (columns < w)
    rows, columns = jnp.clip(rows, 0, h - 1), jnp.clip(columns, 0, w - 1)
    where = (view[:, None, None], rows, columns)
    exists = exists * is_valid(views, *where)
    return PatchBatch(
        view=view,
        rays=rays,
        jitter=jax.random.uniform(key_jitter, (count, size**2, rounds)),
        photo=views.photos[where].astype(jnp.float32) / 255.0,
        exists=exists,
    )
