"""The baseline's losses (arXiv 2111.12077, Eqs. 13-16)."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from alignerf.kernels import calls
from alignerf.mipnerf360 import stepfun

CHARBONNIER_EPS = 0.001


def charbonnier(
    colour: Float[Array, "rays c"],
    photo: Float[Array, "rays c"],
    weight: Float[Array, "rays"],
) -> Float[Array, ""]:
    """Mean of sqrt((colour - photo)^2 + eps^2) over rays of weight one.

    Rays of weight zero do not count; a batch in which none counts gives 0.
    """
    residual = jnp.sqrt((colour - photo) ** 2 + CHARBONNIER_EPS**2)
    return weighted_mean(jnp.mean(residual, axis=-1), weight)


def weighted_mean(x, weight):
    """Mean of x under weights >= 0; 0 where all weights are 0."""
    return jnp.sum(x * weight) / jnp.maximum(jnp.sum(weight), 1e-6)


def interlevel(histograms, *, native=False) -> Float[Array, ""]:
    """Sum over proposals of the mean interlevel loss of a final interval.

    Eq. 13 sums over the intervals; the released code, and so the weight of 1 that
    goes with it, takes their mean. native: whether the kernels are there.
    """
    *proposals, (t, w) = histograms
    if not proposals:
        return jnp.zeros(())
    loss = calls.interlevel if native else stepfun.interlevel_loss
    of_rays = sum(
        jnp.mean(loss(t, w, t_other, w_other)) for t_other, w_other in proposals
    )
    return of_rays / w.shape[-1]


def distortion(histograms) -> Float[Array, ""]:
    """Mean distortion loss of the final histogram."""
    t, w = histograms[-1]
    return jnp.mean(stepfun.distortion_loss(t, w))
