"""NeRF's samples, evenly along a ray and then by the weights of a first look, and the
compositing of what they see.

Notation: t [rays, n] distances along a ray in units of its direction, jitter in [0, 1);
weights of points, or of the intervals between edges. float32, whatever near and far.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from alignerf.mipnerf360 import coord, render, stepfun

# What NeRF, and mip-NeRF after it has blurred them, add to weights: nothing is never
# looked at.
NERF_PADDING, MIPNERF_PADDING = 1e-5, 0.01
# The length behind a ray's last point.
ENDLESS = 1e10
# Beyond it, exp(-tau) is zero in float32.
MAX_TAU = 80.0
EPS = float(jnp.finfo(jnp.float32).eps)


def split_jitter(jitter: Float[Array, "rays n"] | None, counts):
    """A ray's random numbers split by counts; a list of None without any."""
    if jitter is None:
        return (None,) * len(counts)
    ends = [sum(counts[:end]) for end in range(1, len(counts))]
    return jnp.split(jitter, ends, axis=-1)


def stratified(
    jitter: Float[Array, "rays n"] | None,
    near: float | Float[Array, "rays 1"],
    far: float | Float[Array, "rays 1"],
    rays: int,
    count: int,
    spacing: str = "linear",
) -> Float[Array, "rays n"]:
    """`count` distances from near to far, each moved within its share of the way.

    spacing: `linear` in t, or `inverse`, linear in 1 / t, for scenes without a bound.
    """
    s = jnp.broadcast_to(jnp.linspace(0.0, 1.0, count), (rays, count))
    if spacing == "inverse":
        t = coord.s_to_t(s, near, far)
    else:
        t = near * (1.0 - s) + far * s
    return t if jitter is None else moved(jitter, t)


def moved(jitter, t):
    """Each distance moved at random between the midpoints to its neighbours."""
    middle = (t[..., 1:] + t[..., :-1]) / 2
    low = jnp.concatenate([t[..., :1], middle], axis=-1)
    high = jnp.concatenate([middle, t[..., -1:]], axis=-1)
    return low + (high - low) * jitter


def sample_pdf(
    jitter: Float[Array, "rays n"] | None,
    edges: Float[Array, "rays edges"],
    weights: Float[Array, "rays edges-1"],
    count: int,
) -> Float[Array, "rays n"]:
    """`count` distances, in order, as often as the weights say (NeRF, section 5.2).

    One in each of equal shares of the mass, where NeRF draws each from all of it: the
    same distribution with less noise, and in order. Gradients do not pass.
    """
    mass = weights / jnp.maximum(jnp.sum(weights, axis=-1, keepdims=True), 1e-30)
    inner = jnp.minimum(jnp.cumsum(mass[..., :-1], axis=-1), 1.0)
    ends = jnp.zeros_like(mass[..., :1])
    cdf = jnp.concatenate([ends, inner, ends + 1.0], axis=-1)
    if jitter is None:
        u = jnp.broadcast_to(jnp.linspace(0.0, 1.0 - EPS, count), (len(edges), count))
    else:
        u = jnp.minimum((jnp.arange(count)[None] + jitter) / count, 1.0 - EPS)
    return jax.lax.stop_gradient(stepfun.invert_cdf(u, edges, cdf))


def fine_samples(jitter, t, weights, count):
    """NeRF's second look: t, and `count` more where the weights are, in order."""
    middle = (t[..., 1:] + t[..., :-1]) / 2
    more = sample_pdf(jitter, middle, weights[..., 1:-1] + NERF_PADDING, count)
    return stepfun.merge(t, more)


def blurred(weights: Float[Array, "rays n"]) -> Float[Array, "rays n"]:
    """Mip-NeRF's blur: means of the larger of neighbours, and a little (3.2)."""
    padded = jnp.concatenate([weights[..., :1], weights, weights[..., -1:]], axis=-1)
    larger = jnp.maximum(padded[..., :-1], padded[..., 1:])
    return (larger[..., :-1] + larger[..., 1:]) / 2 + MIPNERF_PADDING


def weights_of(
    density: Float[Array, "rays n"], length: Float[Array, "rays n"]
) -> tuple[Float[Array, "rays n"], Float[Array, "rays"]]:
    """(weights of intervals, what passes all of them); together they are one.

    w_i = (1 - exp(-tau_i)) exp(-sum_(j<i) tau_j), tau = density length (NeRF, Eq. 3).
    No inf * 0 arises for an infinite density or a zero length.
    """
    largest = float(jnp.finfo(jnp.float32).max)
    bounded = jnp.minimum(density, largest / jnp.maximum(length, 1.0) / 2)
    tau = jnp.minimum(bounded * length, MAX_TAU)
    passed = jnp.cumsum(tau, axis=-1)
    before = jnp.concatenate([jnp.zeros_like(tau[..., :1]), passed[..., :-1]], axis=-1)
    return -jnp.expm1(-tau) * jnp.exp(-before), jnp.exp(-passed[..., -1])


def lengths(
    t: Float[Array, "rays n"], directions: Float[Array, "rays 3"], last: float
) -> Float[Array, "rays n"]:
    """Of the way from each point to the next, and `last` behind the last one."""
    gaps = t[..., 1:] - t[..., :-1]
    gaps = jnp.concatenate([gaps, jnp.full_like(t[..., :1], last)], axis=-1)
    return gaps * jnp.linalg.norm(directions, axis=-1, keepdims=True)


def with_noise(raw, uniform, std):
    """Raw densities with Gaussian noise made of uniform numbers: NeRF's regulariser."""
    if uniform is None or std == 0.0:
        return raw
    inside = jnp.clip(2.0 * uniform - 1.0, -1.0 + EPS, 1.0 - EPS)
    return raw + std * jnp.sqrt(2.0) * jax.scipy.special.erfinv(inside)


def points_of(
    t: Float[Array, "rays n"],
    origins: Float[Array, "rays 3"],
    directions: Float[Array, "rays 3"],
) -> Float[Array, "3 points"]:
    """Points at distances, channels first."""
    x = origins[:, None, :] + t[..., None] * directions[:, None, :]
    return x.reshape(-1, 3).T


def before(background, values, passed):
    """Colours [rays, 3] before a black or white background, of what passes [rays]."""
    return values + render.BACKGROUNDS[background] * passed[:, None]


def integrate(weights: Float[Array, "rays n"], colours: Float[Array, "3 points"]):
    """Colours [rays, 3] that weights add up to."""
    return render.integrate(weights, colours.reshape(3, *weights.shape))
