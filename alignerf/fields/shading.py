"""Layers that all fields share, and what follows the density: values by view.

Notation: channels first, x [channels, points], points = rays x samples, so that an
elementwise loop runs over points and vectorises whatever the number of channels; v
[rays, 3] unit view directions.
"""

import itertools

import flax.linen as nn
import jax
import jax.numpy as jnp

from alignerf.kernels import calls

# Keeps colours off the sigmoid's flat ends, where gradients vanish.
PADDING = 0.001
DENSITY_BIAS = -1.0
# Kernels are stored [outputs, inputs]; He-uniform as in the published code.
KERNEL_INIT = nn.initializers.he_uniform(in_axis=-1, out_axis=-2)


def product(kernel, x, precision):
    """kernel @ x in float32; `bfloat16` rounds both, and their gradients' factors.

    Sums are float32 in any case, as a TPU multiplies by default.
    """
    if precision == "float32":
        return kernel @ x
    return rounded_product(kernel, x.astype(precision))


@jax.custom_vjp
def rounded_product(kernel, x):
    """kernel @ x in float32, of factors rounded to bfloat16, as x is."""
    factors = kernel.astype(x.dtype), x
    return jnp.matmul(*factors, preferred_element_type=jnp.float32)


def _rounded_product_backward(factors, grad):
    kernel, x = factors
    grad = grad.astype(x.dtype)
    of_x = rounded_product(kernel.T, grad).astype(x.dtype)
    return rounded_product(grad, x.T), of_x


rounded_product.defvjp(
    lambda kernel, x: (rounded_product(kernel, x), (kernel, x)),
    _rounded_product_backward,
)


class Dense(nn.Module):
    """W x + b in float32, with x the inputs' channels one after the other.

    Inputs are [channels, points], or [channels, rays] where all samples of a ray
    share them: what is shared is multiplied once a ray. On a CPU each input has its own
    product, so that nothing is concatenated; elsewhere a product costs a pass over all
    outputs. `precision` is that of the products; parameters stay float32, since Adam's
    steps are often below bfloat16's last digit.
    """

    width: int
    precision: str = "float32"

    @nn.compact
    def __call__(self, *inputs):
        if not calls.on_cpu():
            alike = itertools.groupby(inputs, lambda x: x.shape[1])
            inputs = [jnp.concatenate(list(every)) for _, every in alike]
        channels = [len(x) for x in inputs]
        points = max(x.shape[1] for x in inputs)
        kernel = self.param("kernel", KERNEL_INIT, (self.width, sum(channels)))
        bias = self.param("bias", nn.initializers.zeros, (self.width,))
        total, start = bias[:, None], 0
        for x, count in zip(inputs, channels, strict=True):
            part = product(kernel[:, start : start + count], x, self.precision)
            total = total + jnp.repeat(part, points // x.shape[1], axis=1)
            start += count
        return total


def density_of(raw):
    """softplus(x - 1): starts thin, so that gradients reach all of the ray."""
    return jax.nn.softplus(raw + DENSITY_BIAS)


def encode_direction(v, degrees, fineness=None):
    """[v, sin(2^k v), cos(2^k v)] for k < degrees: [3 + 6 degrees, rays].

    fineness: as of `fine_weights`, with which the degrees come in in turn.
    """
    v = v.T
    scaled = (2.0 ** jnp.arange(degrees)[:, None, None] * v[None]).reshape(
        -1, v.shape[-1]
    )
    waves = jnp.sin(scaled), jnp.cos(scaled)
    if fineness is not None:
        weights = fine_weights(fineness, degrees, at_first=0)
        weights = jnp.repeat(weights, len(v))[:, None]
        waves = tuple(weights * wave for wave in waves)
    return jnp.concatenate([v, *waves])


class Shading(nn.Module):
    """Hidden layers on bottleneck and encoded v, then values in (0, 1), padded."""

    widths: tuple[int, ...]
    outputs: int
    precision: str = "float32"
    view_degrees: int = 4

    @nn.compact
    def __call__(self, bottleneck, viewdirs, fineness=None):
        x = (bottleneck, encode_direction(viewdirs, self.view_degrees, fineness))
        for width in self.widths:
            x = (nn.relu(Dense(width, self.precision)(*x)),)
        raw = Dense(self.outputs, self.precision, name="values")(*x)
        return jax.nn.sigmoid(raw) * (1 + 2 * PADDING) - PADDING


def fine_weights(fineness, count, *, at_first=1):
    """Weights [count] of frequencies or levels, coarse first, that come in in turn.

    fineness in [0, 1]: at 0 as many count as are there `at_first`, at 1 all do (BARF,
    arXiv 2104.06405, Eq. 14, with none at first: its network sees the point too).
    """
    passed = at_first + fineness * (count - at_first) - jnp.arange(count)
    return 0.5 * (1.0 - jnp.cos(jnp.pi * jnp.clip(passed, 0.0, 1.0)))
