"""Contribution 1: patch convolution (AligNeRF, section 3.1).

Volume rendering integrates N features instead of a colour; three 3 x 3
convolutions with ReLU and a linear layer turn the feature image into RGB. The
image is padded by reflection once, by as much as the convolutions eat.

Notation: f [..., h, w, N] feature image, its first three channels the colour that
the pre-trained model would show.
"""

import flax.linen as nn
import jax
import jax.numpy as jnp

from alignerf.fields import shading

LAYERS = 3


class PatchConv(nn.Module):
    """Feature images [..., h, w, N] to colours [..., h, w, 3].

    It starts as the identity on the first three channels: colour passes through
    the ReLUs lifted by the sigmoid's padding (the least value that it has), and
    nothing else reaches it. So fine-tuning starts from the pre-trained function; a
    GPU's default products would round that colour to ten bits.
    """

    @nn.compact
    def __call__(self, f, *, padded=False):
        """padded: f has its border of LAYERS pixels, which the colours have not.

        Raises ValueError for an image too small to reflect (under 4 pixels).
        """
        if not padded:
            f = pad(f)
        batch, features = f.shape[:-3], f.shape[-1]
        f = f.reshape(-1, *f.shape[-3:])
        for layer in range(LAYERS):
            lift = shading.PADDING if layer == 0 else 0.0
            f = nn.Conv(
                features,
                (3, 3),
                padding="VALID",
                precision=jax.lax.Precision.HIGHEST,
                kernel_init=pass_colour_through,
                bias_init=lambda key, shape, dtype, lift=lift: (
                    jnp.zeros(shape, dtype).at[:3].set(lift)
                ),
            )(f)
            f = nn.relu(f)
        rgb = nn.Dense(
            3,
            precision=jax.lax.Precision.HIGHEST,
            kernel_init=lambda key, shape, dtype: jnp.eye(*shape, dtype=dtype),
            bias_init=nn.initializers.constant(-shading.PADDING),
        )(f)
        return rgb.reshape(*batch, *rgb.shape[1:])


def pad(f):
    """Feature images [..., h, w, N] with LAYERS reflected pixels on every side."""
    if min(f.shape[-3:-1]) <= LAYERS:
        raise ValueError(f"patch convolution of {f.shape[-3:-1]} pixels: too small")
    border = (LAYERS, LAYERS)
    none = ((0, 0),)
    return jnp.pad(f, (f.ndim - 3) * none + (border, border, *none), mode="reflect")


def pass_colour_through(key, shape, dtype):
    """He-normal kernel [3, 3, N, N] whose first three outputs copy the inputs."""
    kernel = nn.initializers.he_normal()(key, shape, dtype)
    identity = jnp.zeros((*shape[:3], 3), dtype).at[1, 1].set(jnp.eye(shape[2], 3))
    return kernel.at[..., :3].set(identity)


def widen_values(params, features, key):
    """Parameters of a model whose field gives `features` values instead of 3.

    The first three are the pre-trained colours; the others start at random. Takes
    and returns the model's parameters (`params["field"]["head"]["values"]`).
    """
    values = params["field"]["head"]["values"]
    width = values["kernel"].shape[1]
    fresh = shading.KERNEL_INIT(key, (features, width), jnp.float32)
    widened = {
        "kernel": fresh.at[:3].set(values["kernel"]),
        "bias": jnp.zeros(features).at[:3].set(values["bias"]),
    }
    head = {**params["field"]["head"], "values": widened}
    return jax.tree.map(
        jnp.asarray, {**params, "field": {**params["field"], "head": head}}
    )
