"""Methods as compositions of a model, a way to draw rays, a head and losses.

A method is five functions and two sizes; training and rendering know nothing else
of it. Methods of equal arguments are one object, so that JAX, which knows functions by
their identity, traces each program once in a process.
Notation: params a tree of parameters, one subtree a network; views the training
photos on the device; share in [0, 1] the part of the training that has passed.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from alignerf.contributions import patch_conv
from alignerf.mipnerf360 import losses
from alignerf.rays import rendering as losses_of_rays
from alignerf.scenes import cameras
from alignerf.training import batches


class Method(NamedTuple):
    """What training and rendering need of a method.

    A batch is drawn for one step: arrays that all begin with its units (rays or
    patches), among them `view` [units]. All that is random is drawn with it, and
    terms are means over units, so that parts of a batch average to the whole.
    """

    units: int
    init: Callable  # key -> params
    draw: Callable  # (key of the training, step, views) -> batch
    terms: Callable  # (params, batch, share) -> ({term: mean}, {number: mean})
    render: Callable  # (params, rays [n]) -> model.Rendering
    colours: Callable  # (params, values [h + 2 halo, w + 2 halo, c]) -> RGB [h, w, 3]
    halo: int = 0  # pixels around one that its colour depends on
    # Of single rays: as `terms`, with the rays' values first, [n, c].
    values_and_terms: Callable | None = None
    # (name, rate) of parameters that are no network's: plain gradient descent by this
    # rate makes them means over the last steps.
    running_means: tuple = ()
    # (near, far, radius) of the scene, which `draw` gives to its rays and a renderer to
    # its own. Numbers that programs take, so that all scenes share these.
    bounds: tuple | None = None


@functools.cache
def within(method, bounds) -> Method:
    """The method in a scene of these bounds; None leaves them to the model."""

    def draw(key, step, views):
        batch = method.draw(key, step, views)
        return batch._replace(rays=bounded(batch.rays, bounds))

    return method._replace(draw=draw, bounds=bounds) if bounds else method


def bounded(rays: cameras.Rays, bounds) -> cameras.Rays:
    """The rays with a scene's bounds, if any."""
    if bounds is None:
        return rays
    shape = (*rays.radii.shape[:-1], 3)
    each = jnp.broadcast_to(jnp.asarray(bounds, jnp.float32), shape)
    return rays._replace(bounds=each)


class LossWeights(NamedTuple):
    """Weights of the terms besides the data's."""

    interlevel: float
    distortion: float


def _some_rays():
    """Two rays to initialise a model's shapes with."""
    ones = jnp.ones((2, 3))
    rays = cameras.Rays(ones, ones, ones / jnp.sqrt(3.0), 0.01 * ones[:, :1])
    return bounded(rays, (1.0, 2.0, 1.0))


def _regularisers(histograms, weights, native):
    interlevel = losses.interlevel(histograms, native=native)
    return {
        "interlevel": weights.interlevel * interlevel,
        "distortion": weights.distortion * losses.distortion(histograms),
    }


@functools.cache
def mipnerf360(
    model,
    *,
    batch_rays,
    loss_weights: LossWeights,
    data_loss=losses_of_rays.charbonnier,
    proposal_fraction=1.0,
    coarse_to_fine=(),
) -> Method:
    """The baseline: single rays, Charbonnier loss (arXiv 2111.12077).

    proposal_fraction: share of the rays that train the proposals; as published, all.
    coarse_to_fine: the shares of the training between which fine frequencies are faded
    in (BARF).
    """

    def of_fraction(share):
        shares = {
            "train_fraction": share,
            "proposal_fraction": proposal_fraction,
        }
        if coarse_to_fine:
            shares["fineness"] = passed(share, *coarse_to_fine)
        return shares

    return single_rays(
        model,
        data_loss,
        batch_rays=batch_rays,
        regularisers=functools.partial(
            _regularisers, weights=loss_weights, native=model.native
        ),
        of_fraction=of_fraction,
    )


@functools.cache
def single_rays(
    model, data_loss, *, batch_rays, regularisers=lambda _: {}, of_fraction=lambda _: {}
) -> Method:
    """A model that learns from rays drawn one by one.

    data_loss: (rendering, photo, weight) -> mean, see `rays.rendering`.
    regularisers: histograms -> {term: mean}. of_fraction: fraction of the steps
    done -> keyword arguments of the model.
    """

    def values_and_terms(params, batch, share):
        rendering = model.apply(
            {"params": params["model"]},
            batch.rays,
            jitter=batch.jitter,
            **of_fraction(share),
        )
        error = jnp.mean((rendering.values - batch.photo) ** 2, axis=-1)
        # A part of the batch counts by the weight that it holds of the whole.
        held = jnp.mean(batch.weight)
        data = data_loss(rendering, batch.photo, batch.weight)
        others = regularisers(rendering.histograms)
        mse = losses.weighted_mean(error, batch.weight)
        return rendering.values, {"data": data * held, **others}, {"mse": mse * held}

    return Method(
        units=batch_rays,
        init=lambda key: {"model": model.init(key, _some_rays())["params"]},
        draw=lambda key, step, views: batches.draw_rays(
            key, step, views, batch_rays, model.jitters
        ),
        terms=lambda *arguments: values_and_terms(*arguments)[1:],
        values_and_terms=values_and_terms,
        render=lambda params, rays: model.apply({"params": params["model"]}, rays),
        colours=lambda params, values: values,
    )


def passed(share, first, last):
    """Progress in [0, 1] from the share `first` of the training to the share `last`."""
    return jnp.clip((share - first) / max(last - first, 1e-6), 0.0, 1.0)


@functools.cache
def alignerf(
    model,
    *,
    drawn: batches.Patches,
    convolution,
    losses_of: Callable,
    loss_weights: LossWeights,
    proposal_fraction=1.0,
) -> Method:
    """AligNeRF: patches of rays, patch convolution, and losses of patches.

    losses_of: `methods.base.Part.patch_losses` `terms`. Each can be left out, for the
    ablation. Resampling is not annealed: the proposals are trained when fine-tuning
    starts.
    """
    head, patch_px = patch_conv.PatchConv() if convolution else None, drawn.side_px

    def colours(params, values, *, padded=False):
        if head is None:
            return values
        return head.apply({"params": params["head"]}, values, padded=padded)

    def terms(params, batch, share):
        rays, jitter = jax.tree.map(
            lambda x: x.reshape(-1, x.shape[-1]), (batch.rays, batch.jitter)
        )
        rendering = model.apply(
            {"params": params["model"]},
            rays,
            jitter=jitter,
            proposal_fraction=proposal_fraction,
        )
        values = rendering.values.reshape(-1, patch_px, patch_px, model.field.outputs)
        rgb = colours(params, values)
        found, shown = losses_of(rgb, batch.photo, batch.exists)
        further = _regularisers(rendering.histograms, loss_weights, model.native)
        return {**found, **further}, shown

    def init(key):
        key_model, key_head = jax.random.split(key)
        patch = jnp.zeros((1, patch_px, patch_px, model.field.outputs))
        params = {"model": model.init(key_model, _some_rays())["params"]}
        if head:
            params["head"] = head.init(key_head, patch)["params"]
        return params

    return Method(
        units=drawn.count,
        init=init,
        draw=lambda key, step, views: batches.draw_patches(
            key, step, views, drawn, model.jitters
        ),
        terms=terms,
        render=lambda params, rays: model.apply({"params": params["model"]}, rays),
        colours=lambda params, values: colours(params, values, padded=True),
        halo=patch_conv.LAYERS if convolution else 0,
    )
