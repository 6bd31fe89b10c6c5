"""Methods as compositions of a model, a way to draw rays, a head and losses.

A method is five functions and two sizes; training and rendering know nothing else
of it.
Notation: params a tree of parameters, one subtree a network; views the training
photos on the device; share in [0, 1] the part of the training that has passed.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from alignerf import align_loss, cameras, frequency_loss, patch_conv
from alignerf.mipnerf360 import losses


class Views(NamedTuple):
    """Training views in memory."""

    photos: Any  # [n, h, w, 3] uint8
    valid: Any  # [n, h, ceil(w / 8)] uint8, from pack_valid; None: every pixel counts
    pixtocams: Any  # [n, 3, 3]
    camtoworlds: Any  # [n, 3, 4]


class Method(NamedTuple):
    """What training and rendering need of a method.

    A batch is drawn for one step: arrays that all begin with its units (rays or
    patches), among them `view` [units]. All that is random is drawn with it, and
    terms are means over units, so that parts of a batch average to the whole.
    """

    units: int
    init: Callable  # key -> params
    draw: Callable  # (key, views) -> batch
    terms: Callable  # (params, batch, share) -> ({term: mean}, {number: mean})
    render: Callable  # (params, rays [n]) -> model.Rendering
    colours: Callable  # (params, values [h + 2 halo, w + 2 halo, c]) -> RGB [h, w, 3]
    halo: int = 0  # pixels around one that its colour depends on


class RayBatch(NamedTuple):
    """Single rays; the weights are 1 on average, or all 0."""

    view: Any  # [n]
    rays: Any  # cameras.Rays [n]
    jitter: Any  # [n, rounds] of the samples, in [0, 1)
    photo: Any  # [n, 3]
    weight: Any  # [n]


class PatchBatch(NamedTuple):
    """Square patches of p x p rays in the middle of q x q pixels of a photo."""

    view: Any  # [n]
    rays: Any  # cameras.Rays [n, p p]
    jitter: Any  # [n, p p, rounds]
    photo: Any  # [n, q, q, 3]
    exists: Any  # [n, q, q], zero beyond the photo's border


def pack_valid(mask):
    """Bits [..., h, ceil(w / 8)] of a mask [..., h, w]: 1/24 of its photo's size."""
    return np.packbits(mask, axis=-1)


def is_valid(views: Views, view, y, x):
    """One where a pixel counts, else zero, as float32."""
    if views.valid is None:
        return jnp.ones(view.shape)
    bits = views.valid[view, y, x // 8] >> (7 - x % 8).astype(jnp.uint8)
    return (bits & 1).astype(jnp.float32)


def draw_rays(key, views: Views, count, rounds) -> RayBatch:
    """Pixels drawn uniformly from all views."""
    n, h, w, _ = views.photos.shape
    key_view, key_y, key_x, key_jitter = jax.random.split(key, 4)
    view = jax.random.randint(key_view, (count,), 0, n)
    y = jax.random.randint(key_y, (count,), 0, h)
    x = jax.random.randint(key_x, (count,), 0, w)
    weight = is_valid(views, view, y, x)
    return RayBatch(
        view=view,
        rays=cameras.pixels_to_rays(
            x, y, views.pixtocams[view], views.camtoworlds[view]
        ),
        jitter=jax.random.uniform(key_jitter, (count, rounds)),
        photo=views.photos[view, y, x].astype(jnp.float32) / 255.0,
        weight=weight / jnp.maximum(jnp.mean(weight), 1e-6),
    )


def draw_patches(key, views: Views, count, size, radius, rounds) -> PatchBatch:
    """Patches drawn uniformly from all views, size p, with q = p + 2 radius."""
    n, h, w, _ = views.photos.shape
    key_view, key_y, key_x, key_jitter = jax.random.split(key, 4)
    view = jax.random.randint(key_view, (count,), 0, n)
    top = jax.random.randint(key_y, (count,), 0, h - size + 1)
    left = jax.random.randint(key_x, (count,), 0, w - size + 1)
    inner, outer = jnp.arange(size), jnp.arange(-radius, size + radius)
    y = jnp.broadcast_to(top[:, None, None] + inner[:, None], (count, size, size))
    x = jnp.broadcast_to(left[:, None, None] + inner[None, :], (count, size, size))
    camera = views.pixtocams[view][:, None], views.camtoworlds[view][:, None]
    rays = cameras.pixels_to_rays(x.reshape(count, -1), y.reshape(count, -1), *camera)
    rows, columns = top[:, None] + outer, left[:, None] + outer
    exists = ((rows >= 0) & (rows < h))[:, :, None]
    exists = exists & ((columns >= 0) & (columns < w))[:, None, :]
    rows, columns = jnp.clip(rows, 0, h - 1), jnp.clip(columns, 0, w - 1)
    where = (view[:, None, None], rows[:, :, None], columns[:, None, :])
    return PatchBatch(
        view=view,
        rays=rays,
        jitter=jax.random.uniform(key_jitter, (count, size**2, rounds)),
        photo=views.photos[where].astype(jnp.float32) / 255.0,
        exists=exists.astype(jnp.float32),
    )


def _some_rays():
    """Two rays to initialise a model's shapes with."""
    ones = jnp.ones((2, 3))
    return cameras.Rays(ones, ones, ones / jnp.sqrt(3.0), 0.01 * ones[:, :1])


def _regularisers(histograms, weights):
    return {
        "interlevel": weights["interlevel"] * losses.interlevel(histograms),
        "distortion": weights["distortion"] * losses.distortion(histograms),
    }


def mipnerf360(model, *, batch_rays, loss_weights, annealed=True) -> Method:
    """The baseline: single rays, Charbonnier loss (arXiv 2111.12077).

    annealed: early in training samples spread beyond where the proposals put them;
    not so for a training that begins with trained proposals.
    """

    def terms(params, batch, share):
        rendering = model.apply(
            {"params": params["model"]},
            batch.rays,
            jitter=batch.jitter,
            train_share=share if annealed else 1.0,
        )
        error = jnp.mean((rendering.values - batch.photo) ** 2, axis=-1)
        # A part of the batch counts by the weight that it holds of the whole.
        held = jnp.mean(batch.weight)
        data = losses.charbonnier(rendering.values, batch.photo, batch.weight)
        regularisers = _regularisers(rendering.histograms, loss_weights)
        mse = losses.weighted_mean(error, batch.weight)
        return {"data": data * held, **regularisers}, {"mse": mse * held}

    return Method(
        units=batch_rays,
        init=lambda key: {"model": model.init(key, _some_rays())["params"]},
        draw=lambda key, views: draw_rays(key, views, batch_rays, len(model.samples)),
        terms=terms,
        render=lambda params, rays: model.apply({"params": params["model"]}, rays),
        colours=lambda params, values: values,
    )


def aligned_loss(rgb, photo, exists, penalty):
    """(best photo patches, L_PM of Eq. 4, numbers to show) of renders [n, p, p, 3].

    L_PM is the mean over the n patches of the squared error summed over a patch,
    plus the penalty of its offset.
    """
    aligned = jax.vmap(lambda r, g, e: align_loss.align(r, g, e, penalty=penalty))(
        rgb, photo, exists
    )
    length = jnp.sqrt(jnp.sum(aligned.offset_px.astype(jnp.float32) ** 2, axis=-1))
    squared = jnp.sum((aligned.patch - rgb) ** 2, axis=(1, 2, 3))
    loss = jnp.mean(squared + penalty * length)
    mse = jnp.mean(squared) / rgb[0].size
    return aligned.patch, loss, {"mse": mse, "offset_px": jnp.mean(length)}


def alignerf(
    model,
    *,
    patches,
    patch_px,
    radius_px,
    align_penalty,
    frequency_weight,
    frequency_features,
    loss_weights,
) -> Method:
    """AligNeRF: patches of rays, patch convolution, aligned and frequency losses.

    Resampling is not annealed: the proposals are trained when fine-tuning starts.
    """
    head = patch_conv.PatchConv()

    def terms(params, batch, share):
        rays, jitter = jax.tree.map(
            lambda x: x.reshape(-1, x.shape[-1]), (batch.rays, batch.jitter)
        )
        rendering = model.apply({"params": params["model"]}, rays, jitter=jitter)
        values = rendering.values.reshape(-1, patch_px, patch_px, model.field.outputs)
        rgb = head.apply({"params": params["head"]}, values)
        patch, data, shown = aligned_loss(rgb, batch.photo, batch.exists, align_penalty)
        frequency = frequency_loss.frequency_loss(frequency_features, patch, rgb)
        # Both as printed (a sum over the patch, a mean over the features), and both
        # in units of one colour value, so that the regularisers weigh what they did.
        return {
            "data": data / rgb[0].size,
            "frequency": frequency_weight * frequency / rgb[0].size,
            **_regularisers(rendering.histograms, loss_weights),
        }, shown

    def init(key):
        key_model, key_head = jax.random.split(key)
        patch = jnp.zeros((1, patch_px, patch_px, model.field.outputs))
        return {
            "model": model.init(key_model, _some_rays())["params"],
            "head": head.init(key_head, patch)["params"],
        }

    return Method(
        units=patches,
        init=init,
        draw=lambda key, views: draw_patches(
            key, views, patches, patch_px, radius_px, len(model.samples)
        ),
        terms=terms,
        render=lambda params, rays: model.apply({"params": params["model"]}, rays),
        colours=lambda params, values: head.apply(
            {"params": params["head"]}, values, padded=True
        ),
        halo=patch_conv.LAYERS,
    )
