"""Methods as compositions of a model, a way to draw rays, a head and losses.

A method is four functions; training and rendering know nothing else of it.
Notation: params a tree of parameters, one subtree a network; views the training
photos on the device; share in [0, 1] the part of the training that has passed.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from alignerf import align_loss, cameras, frequency_loss, patch_conv
from alignerf.mipnerf360 import losses


class Views(NamedTuple):
    """Training views on the device."""

    photos: Any  # [n, h, w, 3] uint8
    valid: Any  # [n, h, w] bool
    pixtocams: Any  # [n, 3, 3]
    camtoworlds: Any  # [n, 3, 4]


class Method(NamedTuple):
    """What training and rendering need of a method."""

    init: Callable  # key -> params
    loss: Callable  # (params, views, key, share) -> (loss, {term: value})
    render: Callable  # (params, rays [n]) -> model.Rendering
    colours: Callable  # (params, values [h, w, c]) -> RGB [h, w, 3]


def draw_rays(key, views: Views, count):
    """Pixels drawn uniformly from all views: rays, colours [n, 3], weights [n]."""
    n, h, w = views.valid.shape
    key_view, key_y, key_x = jax.random.split(key, 3)
    view = jax.random.randint(key_view, (count,), 0, n)
    y = jax.random.randint(key_y, (count,), 0, h)
    x = jax.random.randint(key_x, (count,), 0, w)
    rays = cameras.pixels_to_rays(x, y, views.pixtocams[view], views.camtoworlds[view])
    colour = views.photos[view, y, x].astype(jnp.float32) / 255.0
    return rays, colour, views.valid[view, y, x].astype(jnp.float32)


def draw_patches(key, views: Views, count, size, radius):
    """Square patches of rays, and the larger photo patches around them.

    Returns rays [count size size], photo [count, q, q, 3] and exists [count, q, q]
    with q = size + 2 radius; beyond the photo's border nothing exists.
    """
    n, h, w = views.valid.shape
    key_view, key_y, key_x = jax.random.split(key, 3)
    view = jax.random.randint(key_view, (count,), 0, n)
    top = jax.random.randint(key_y, (count,), 0, h - size + 1)
    left = jax.random.randint(key_x, (count,), 0, w - size + 1)
    inner, outer = jnp.arange(size), jnp.arange(-radius, size + radius)
    y = jnp.broadcast_to(top[:, None, None] + inner[:, None], (count, size, size))
    x = jnp.broadcast_to(left[:, None, None] + inner[None, :], (count, size, size))
    each = jnp.repeat(view, size * size)
    rays = cameras.pixels_to_rays(
        x.reshape(-1), y.reshape(-1), views.pixtocams[each], views.camtoworlds[each]
    )
    rows, columns = top[:, None] + outer, left[:, None] + outer
    exists = ((rows >= 0) & (rows < h))[:, :, None]
    exists = exists & ((columns >= 0) & (columns < w))[:, None, :]
    rows, columns = jnp.clip(rows, 0, h - 1), jnp.clip(columns, 0, w - 1)
    where = (view[:, None, None], rows[:, :, None], columns[:, None, :])
    photo = views.photos[where].astype(jnp.float32) / 255.0
    return rays, photo, exists.astype(jnp.float32)


def _some_rays():
    """Two rays to initialise a model's shapes with."""
    ones = jnp.ones((2, 3))
    return cameras.Rays(ones, ones, ones / jnp.sqrt(3.0), 0.01 * ones[:, :1])


def _regularisers(histograms, weights):
    return {
        "interlevel": weights["interlevel"] * losses.interlevel(histograms),
        "distortion": weights["distortion"] * losses.distortion(histograms),
    }


def _mse_to_psnr(mse):
    return -10.0 / jnp.log(10.0) * jnp.log(jnp.maximum(mse, 1e-10))


def mipnerf360(model, *, batch_rays, loss_weights) -> Method:
    """The baseline: single rays, Charbonnier loss (arXiv 2111.12077)."""

    def loss(params, views, key, share):
        key_rays, key_samples = jax.random.split(key)
        rays, photo, weight = draw_rays(key_rays, views, batch_rays)
        rendering = model.apply(
            {"params": params["model"]}, rays, key=key_samples, train_share=share
        )
        terms = {
            "data": losses.charbonnier(rendering.values, photo, weight),
            **_regularisers(rendering.histograms, loss_weights),
        }
        error = jnp.mean((rendering.values - photo) ** 2, axis=-1)
        psnr = _mse_to_psnr(losses.weighted_mean(error, weight))
        return sum(terms.values()), {**terms, "psnr_db": psnr}

    return Method(
        init=lambda key: {"model": model.init(key, _some_rays())["params"]},
        loss=loss,
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
    psnr = _mse_to_psnr(jnp.mean(squared) / rgb[0].size)
    return aligned.patch, loss, {"psnr_db": psnr, "offset_px": jnp.mean(length)}


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

    def loss(params, views, key, share):
        key_rays, key_samples = jax.random.split(key)
        rays, photo, exists = draw_patches(
            key_rays, views, patches, patch_px, radius_px
        )
        rendering = model.apply({"params": params["model"]}, rays, key=key_samples)
        shape = (patches, patch_px, patch_px, -1)
        rgb = head.apply({"params": params["head"]}, rendering.values.reshape(shape))
        patch, data, stats = aligned_loss(rgb, photo, exists, align_penalty)
        frequency = frequency_loss.frequency_loss(frequency_features, patch, rgb)
        # Both as printed (a sum over the patch, a mean over the features), and both
        # in units of one colour value, so that the regularisers weigh what they did.
        terms = {
            "data": data / rgb[0].size,
            "frequency": frequency_weight * frequency / rgb[0].size,
            **_regularisers(rendering.histograms, loss_weights),
        }
        return sum(terms.values()), {**terms, **stats}

    def init(key):
        key_model, key_head = jax.random.split(key)
        patch = jnp.zeros((1, patch_px, patch_px, model.field.outputs))
        return {
            "model": model.init(key_model, _some_rays())["params"],
            "head": head.init(key_head, patch)["params"],
        }

    return Method(
        init=init,
        loss=loss,
        render=lambda params, rays: model.apply({"params": params["model"]}, rays),
        colours=lambda params, values: head.apply({"params": params["head"]}, values),
    )
