"""Volume rendering: from interval edges and densities to weights and values.

Notation: tdist [..., edges] metric edges, density [..., edges - 1], weights
likewise, values [c, ..., edges - 1] what is integrated (colour or features).
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from alignerf.mipnerf360 import coord

# Beyond it exp(-tau) is zero in float32, beside one: 1 - exp(-80) is 1.
MAX_TAU = 80.0
BACKGROUNDS = {"black": 0.0, "white": 1.0}


def cast_cones(
    tdist: Float[Array, "*batch edges"],
    origins: Float[Array, "*batch 3"],
    directions: Float[Array, "*batch 3"],
    radii: Float[Array, "*batch 1"],
) -> coord.Gaussians:
    """Gaussians of the conical frustums between edges (mip-NeRF, Eq. 7).

    In the stable form around the mean, with lengths measured in units of the
    far edge, so that edges up to 1e18 neither overflow nor cancel.
    """
    t0, t1 = tdist[..., :-1], tdist[..., 1:]
    unit = jnp.maximum(t1, jnp.finfo(tdist.dtype).tiny)
    # Scaled midpoint and half-width; the far edge is 1, so both are below 1.
    mu = (t0 / unit + 1.0) / 2
    # Of the edges as given, since t0 / unit has lost the digits of a thin interval.
    hw = (t1 - t0) / unit / 2
    below = 3 * mu**2 + hw**2
    t_mean = mu + 2 * mu * hw**2 / below
    t_var = hw**2 / 3 - (4 / 15) * hw**4 * (12 * mu**2 - hw**2) / below**2
    r_var = mu**2 / 4 + (5 / 12) * hw**2 - (4 / 15) * hw**4 / below
    t_mean, t_std = t_mean * unit, jnp.sqrt(jnp.maximum(t_var, 1e-20)) * unit
    r_std = radii * jnp.sqrt(r_var) * unit
    directions = jnp.broadcast_to(directions[..., None, :], (*t_mean.shape, 3))
    mean = origins[..., None, :] + t_mean[..., None] * directions
    return coord.Gaussians(mean, directions, t_std, r_std)


def alpha_weights(
    density: Float[Array, "*batch bins"],
    tdist: Float[Array, "*batch bins+1"],
    directions: Float[Array, "*batch 3"],
    *,
    opaque: bool = True,
) -> Float[Array, "*batch bins"]:
    """Weights w_i = (1 - exp(-tau_i)) exp(-sum_(j<i) tau_j).

    opaque: the last interval stops all that comes to it, so that the weights add up to
    one. tau_i = density_i * length_i is capped at 80, beyond which exp(-tau) is zero
    in float32: no inf * 0 arises for an infinite density or a zero length.
    """
    length = (tdist[..., 1:] - tdist[..., :-1]) * jnp.linalg.norm(
        directions, axis=-1, keepdims=True
    )
    bins = density.shape[-1]
    is_last = opaque & (jnp.arange(bins) == bins - 1)
    # Of an opaque interval neither length nor density counts, though both be infinite.
    length = jnp.where(is_last, 0.0, length)
    largest = jnp.finfo(density.dtype).max
    bounded = jnp.minimum(density, largest / jnp.maximum(length, 1.0) / 2)
    tau = jnp.where(is_last, MAX_TAU, jnp.minimum(bounded * length, MAX_TAU))
    # Sums of all that lies before, as a small matrix product: a tenth of a render less
    # than by a cumulative sum.
    earlier = jnp.triu(jnp.ones((bins, bins), tau.dtype), 1)
    before = jnp.matmul(tau, earlier, precision=jax.lax.Precision.HIGHEST)
    return -jnp.expm1(-tau) * jnp.exp(-before)


def integrate(
    weights: Float[Array, "rays bins"], values: Float[Array, "c rays bins"]
) -> Float[Array, "rays c"]:
    """Sum of weighted values along the ray."""
    return jnp.sum(weights[None] * values, axis=-1).T


def before(
    background: str, values: Float[Array, "rays c"], weights: Float[Array, "rays bins"]
) -> Float[Array, "rays c"]:
    """Values with a black or white background added, as far as weights let it through.

    The first three values are colours; others have no background.
    """
    passed = jnp.maximum(1.0 - jnp.sum(weights, axis=-1, keepdims=True), 0.0)
    return values.at[:, :3].add(BACKGROUNDS[background] * passed)


def median_distance(
    weights: Float[Array, "*batch bins"], tdist: Float[Array, "*batch bins+1"]
) -> Float[Array, "*batch"]:
    """Distance at which half of the weight lies in front (a robust depth)."""
    passed = jnp.cumsum(weights, axis=-1) < 0.5
    index = jnp.minimum(jnp.sum(passed, axis=-1), weights.shape[-1] - 1)
    middle = (tdist[..., 1:] + tdist[..., :-1]) / 2
    return jnp.take_along_axis(middle, index[..., None], axis=-1)[..., 0]
