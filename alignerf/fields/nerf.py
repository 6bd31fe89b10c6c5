"""The field of NeRF, as BARF has it: sines of a point into one MLP, no contraction.

Notation: x [3, points] a point in the normalised scene, L degrees 0 .. L - 1 of
sin(2^k pi x) and cos(2^k pi x). NeRF (arXiv 2003.08934, section 5.1); BARF (arXiv
2104.06405, Eqs. 13 and 14; 530,052 parameters). A Gaussian counts by its mean alone.
Otherwise than in BARF view directions are encoded without pi, colours are padded as all
heads' here are, and layers start as all fields' do.
"""

import flax.linen as nn
import jax
import jax.numpy as jnp

from alignerf.fields import shading


def encode(x, degrees, fineness=None):
    """[x, sin, cos] [3 + 6 degrees, points]; degrees come in in turn by `fineness`.

    The point itself is there from the start, so that even the first degree waits.
    """
    scales = jnp.pi * 2.0 ** jnp.arange(degrees)
    scaled = scales[:, None, None] * x[None]
    waves = jnp.stack([jnp.sin(scaled), jnp.cos(scaled)])
    if fineness is not None:
        weights = shading.fine_weights(fineness, degrees, at_first=0)
        waves = waves * weights[None, :, None, None]
    return jnp.concatenate([x, waves.reshape(-1, x.shape[-1])])


class Nerf(nn.Module):
    """Density and values of points; the density comes with the last layer."""

    width: int = 256
    depth: int = 8
    skip_after: int = 4
    degrees: int = 10
    view_degrees: int = 4
    view_width: int = 128
    outputs: int = 3
    precision: str = "float32"

    @nn.compact
    def __call__(self, gaussians, viewdirs=None, fineness=None):
        batch = gaussians.mean.shape[:-1]
        encoded = encode(gaussians.mean.reshape(-1, 3).T, self.degrees, fineness)
        x = (encoded,)
        for layer in range(self.depth):
            if layer == self.skip_after:
                x = (*x, encoded)
            last = layer == self.depth - 1
            outputs = shading.Dense(self.width + last, self.precision)(*x)
            if last:
                raw, outputs = outputs[:1], outputs[1:]
            x = (nn.relu(outputs),)
        density = jax.nn.softplus(raw).reshape(batch)
        if viewdirs is None:
            return density, None
        head = shading.Shading(
            (self.view_width,),
            self.outputs,
            self.precision,
            self.view_degrees,
            name="head",
        )
        return density, head(*x, viewdirs, fineness).reshape(-1, *batch)
