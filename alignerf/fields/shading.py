"""What every field does after its density: from bottleneck and view to values.

Notation: b [..., samples, width] bottleneck, v [..., 3] unit view direction.
"""

import flax.linen as nn
import jax
import jax.numpy as jnp

# Keeps colours off the sigmoid's flat ends, where gradients vanish.
PADDING = 0.001
DENSITY_BIAS = -1.0


def density_of(raw):
    """softplus(x - 1): starts thin, so that gradients reach all of the ray."""
    return jax.nn.softplus(raw + DENSITY_BIAS)


def encode_direction(v, degrees):
    """[v, sin(2^k v), cos(2^k v)] for k < degrees: 3 + 6 degrees numbers."""
    scaled = (v[..., None, :] * 2.0 ** jnp.arange(degrees)[:, None]).reshape(
        *v.shape[:-1], -1
    )
    return jnp.concatenate([v, jnp.sin(scaled), jnp.cos(scaled)], axis=-1)


class Shading(nn.Module):
    """Hidden layers on [b, encoded v], then `outputs` values in (0, 1), padded."""

    widths: tuple[int, ...]
    outputs: int
    view_degrees: int = 4

    @nn.compact
    def __call__(self, bottleneck, viewdirs):
        view = encode_direction(viewdirs, self.view_degrees)
        view = jnp.broadcast_to(
            view[..., None, :], (*bottleneck.shape[:-1], view.shape[-1])
        )
        x = jnp.concatenate([bottleneck, view], axis=-1)
        for width in self.widths:
            x = nn.relu(dense(width)(x))
        raw = dense(self.outputs, name="values")(x)
        return jax.nn.sigmoid(raw) * (1 + 2 * PADDING) - PADDING


def dense(width, name=None):
    """Dense layer with the paper's He-uniform initialisation."""
    return nn.Dense(width, kernel_init=nn.initializers.he_uniform(), name=name)
