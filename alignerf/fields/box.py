"""Instant-NGP's field: a hash grid in a box, two small networks without biases.

Notation as in `grid`. arXiv 2201.05989; sizes and constants of NVlabs/instant-ngp,
configs/nerf/big.json before 2023-02-23. With 16 levels of 2^21 rows and a box of side
32: 51,857,552 parameters. Where its own code puts a level's first corner half a cell
outside the box, ours puts it on the rim.
"""

import math

import flax.linen as nn
import jax
import jax.numpy as jnp

from alignerf.fields import encoding, grid, shading, space

# Rows of a level are a multiple of it, outputs of a network at least so many: what its
# GPU code asks for. They count as parameters.
ROW_MULTIPLE, MIN_OUTPUTS = 8, 16
# exp(x) up to e^15: beyond it a ray is opaque at any length.
MAX_LOG_DENSITY = 15.0


def levels_of(
    levels, log2_hashmap_size, base_resolution, max_resolution, side
) -> grid.Levels:
    """The layout of instant-ngp's table: corners a side and rows of each level.

    max_resolution: cells over a length of 1, of the last level.
    """
    growth = math.log2(max_resolution * side / base_resolution) / max(levels - 1, 1)
    corners = [
        math.ceil(2.0 ** (level * growth) * base_resolution - 1.0) + 1
        for level in range(levels)
    ]
    rows = [-(-(count**3) // ROW_MULTIPLE) * ROW_MULTIPLE for count in corners]
    return grid.Levels(
        tuple(count - 1 for count in corners),
        tuple(min(count, 2**log2_hashmap_size) for count in rows),
    )


def product(module, name, width, x):
    """A layer without biases."""
    kernel = module.param(name, shading.KERNEL_INIT, (width, len(x)))
    return shading.product(kernel, x, module.precision)


class Box(nn.Module):
    """Density and colours of Gaussians' means; outside the box there is nothing."""

    side: float = 32.0
    levels: int = 16
    log2_hashmap_size: int = 21
    features: int = 2
    base_resolution: int = 16
    max_resolution: int = 2048
    width: int = 64
    precision: str = "float32"
    moving: bool = False
    native: bool = False
    # Colours are all that it gives.
    outputs: int = 3

    @nn.compact
    def __call__(self, gaussians, viewdirs=None):
        batch = gaussians.mean.shape[:-1]
        at, inside = space.in_box(gaussians.mean.reshape(-1, 3), self.side)
        levels = levels_of(
            *(
                self.levels,
                self.log2_hashmap_size,
                self.base_resolution,
                self.max_resolution,
                self.side,
            )
        )
        table = self.param(
            "table", grid.table_init, (sum(levels.entries), self.features)
        )
        whole = jnp.ones((self.levels, len(at)))
        how = {"moving": self.moving, "native": self.native}
        x = grid.features_of(table, at.T, whole, levels, **how)
        x = nn.relu(product(self, "density_0", self.width, x))
        x = product(self, "density_1", MIN_OUTPUTS, x)
        density = jnp.exp(jnp.minimum(x[0], MAX_LOG_DENSITY)) * inside
        density = density.reshape(batch)
        if viewdirs is None:
            return density, None
        seen = encoding.harmonics(viewdirs.T)
        seen = jnp.repeat(seen, x.shape[1] // seen.shape[1], axis=1)
        x = jnp.concatenate([x, seen])
        for layer in range(2):
            x = nn.relu(product(self, f"colour_{layer}", self.width, x))
        colours = product(self, "colour_2", MIN_OUTPUTS, x)[:3]
        return density, jax.nn.sigmoid(colours).reshape(3, *batch)
