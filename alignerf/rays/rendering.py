"""The losses on a `mipnerf360.model.Rendering`, which every system's model gives.

A loss is a function (rendering, photo [rays, 3], weight [rays]) -> mean over the rays;
a weight of zero leaves a ray out.
"""

import functools

import jax.numpy as jnp
from jaxtyping import Array, Float

from alignerf.mipnerf360 import losses

# Where Huber's loss goes over from a square to a line, in instant-ngp.
HUBER = 0.1


def depth_of(weights: Float[Array, "rays n"], t: Float[Array, "rays n"]):
    """The distance at which half of a ray's weight lies in front; its end if less."""
    passed = jnp.cumsum(weights, axis=-1) < 0.5
    index = jnp.minimum(jnp.sum(passed, axis=-1), t.shape[-1] - 1)
    return jnp.take_along_axis(t, index[..., None], axis=-1)[..., 0]


@functools.cache
def squared(*, coarse=0.0):
    """The squared error, and `coarse` times that of each earlier look."""

    def loss(rendering, photo, weight):
        error = mean_square(rendering.values, photo, weight)
        if not coarse:
            return error
        return error + coarse * sum(
            mean_square(values, photo, weight) for values in rendering.coarse
        )

    return loss


def charbonnier(rendering, photo, weight):
    """Mip-NeRF 360's loss: as the square where it is small, beyond as the distance."""
    return losses.charbonnier(rendering.values, photo, weight)


def mean_square(values, photo, weight):
    """Mean squared error over channels and rays."""
    return losses.weighted_mean(jnp.mean((values - photo) ** 2, axis=-1), weight)


def huber(rendering, photo, weight):
    """Huber's loss: a square up to HUBER, a line of the same slope beyond."""
    error = jnp.abs(rendering.values - photo)
    large = error > HUBER
    # Not the minimum, whose slope is halved where both are equal.
    square = 0.5 / HUBER * jnp.where(large, HUBER, error) ** 2
    loss = jnp.where(large, error - 0.5 * HUBER, square)
    return losses.weighted_mean(jnp.mean(loss, axis=-1), weight)
