"""The network of NeRF, which mip-NeRF and NeRF++ kept: points to density and colour.

Its input, an encoding of points, comes in again after layer `skip_after`; the density
stands before the bottleneck, view directions after it. 595,844 parameters with 63
inputs (arXiv 2003.08934, figure 7).
"""

import flax.linen as nn
import jax

from alignerf.fields import shading


class Radiance(nn.Module):
    """[inputs, points] and view directions [rays, 3] to (raw density, colours).

    Raw densities [points] are before their activation, which a system chooses; colours
    [3, points] lie in [0, 1], or `padding` beyond.
    """

    width: int = 256
    depth: int = 8
    skip_after: int = 5
    bottleneck: int = 256
    view_width: int = 128
    view_degrees: int = 4
    padding: float = 0.0
    precision: str = "float32"

    @nn.compact
    def __call__(self, encoded, viewdirs):
        x = (encoded,)
        for layer in range(self.depth):
            if layer == self.skip_after:
                x = (*x, encoded)
            x = (nn.relu(shading.Dense(self.width, self.precision)(*x)),)
        raw = shading.Dense(1, self.precision, name="density")(*x)[0]
        x = shading.Dense(self.bottleneck, self.precision, name="bottleneck")(*x)
        seen = shading.encode_direction(viewdirs, self.view_degrees)
        x = nn.relu(shading.Dense(self.view_width, self.precision)(x, seen))
        colours = shading.Dense(3, self.precision, name="values")(x)
        colours = jax.nn.sigmoid(colours.astype("float32"))
        colours = colours * (1 + 2 * self.padding) - self.padding
        return raw.astype("float32"), colours
