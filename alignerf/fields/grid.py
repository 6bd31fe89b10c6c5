"""The fast field: a multi-resolution hash grid with anti-aliasing.

Notation: n points, levels l of resolution N_l (geometric from base_resolution to
max_resolution), a table of `entries` feature vectors each; x in [0, 1]^3 the contracted
position, sigma the Gaussian's radius in the same units. instant-ngp (arXiv
2201.05989), anti-aliased as zip-NeRF (arXiv 2304.06706, Eq. 5).
"""

import functools
import itertools
from typing import NamedTuple

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np

from alignerf.fields import shading
from alignerf.kernels import calls
from alignerf.mipnerf360 import coord

PRIMES = (1, 2654435761, 805459861)
# The contraction's ball of radius 2, with room for rounding at its rim.
EXTENT = 2.001


class Levels(NamedTuple):
    """The layout of all levels in one table; hashable, known at compile time."""

    resolutions: tuple[int, ...]
    entries: tuple[int, ...]

    @classmethod
    def geometric(cls, levels, base_resolution, max_resolution, max_entries):
        """Levels of geometric resolution, dense where their corners fit."""
        sides = np.round(np.geomspace(base_resolution, max_resolution, levels)).astype(
            int
        )
        entries = [min(max_entries, (int(side) + 1) ** 3) for side in sides]
        return cls(tuple(map(int, sides)), tuple(entries))

    @property
    def offsets(self):
        return np.concatenate([[0], np.cumsum(self.entries)])[:-1]


# Of a cell: which end along x, y and z.
CORNERS = np.array(list(itertools.product((0, 1), repeat=3)), np.int32)


def cells_of(points, levels: Levels):
    """Each point's cell along each axis: (part of a row, stride, share), see `end_of`.

    points [3, n] in [0, 1]; part and share [levels, n], stride [levels, 1]. Rows are
    32-bit signed integers: with an [n, 8] index array, or unsigned ones, XLA's CPU code
    does not vectorise and takes ten times as long.
    """
    resolution = np.array(levels.resolutions, np.float32)[:, None]
    dense, side, _ = layout(levels)
    cells = []
    for axis, value in enumerate(points):
        stride = np.where(dense, side**axis, PRIMES[axis])
        stride = stride.astype(np.uint32).view(np.int32)
        scaled = value[None] * resolution
        cell = jnp.clip(scaled.astype(jnp.int32), 0, resolution.astype(np.int32) - 1)
        share = scaled - cell.astype(jnp.float32)
        cells.append((cell * stride, stride, share))
    return cells


def end_of(cell, end):
    """(part of a row, weight) of a cell's end, 0 or 1, along its axis.

    Worked out anew for each corner: both ends of all cells, stored, leave the caches,
    and took a sixteenth of a training step.
    """
    part, stride, share = cell
    return part + end * stride, jnp.where(end == 1, share, 1.0 - share)


def layout(levels: Levels):
    """Of each level [levels, 1]: whether it is dense, corners a side, entries."""
    entries = np.array(levels.entries, np.int32)[:, None]
    side = np.array(levels.resolutions, np.int64)[:, None] + 1
    return side**3 <= entries, side, entries


def corner_of(cells, ends, levels: Levels):
    """(rows of the table, weights), both [levels, n], of one corner of each cell."""
    chosen = [end_of(cell, end) for cell, end in zip(cells, ends, strict=True)]
    (x, y, z), (a, b, c) = zip(*chosen, strict=True)
    dense, _, entries = layout(levels)
    row = jnp.where(dense, x + y + z, (x ^ y ^ z) & (entries - 1))
    return row + levels.offsets.astype(np.int32)[:, None], a * b * c


def slopes_of(cells, ends, levels: Levels):
    """Derivatives [3, levels, n] of a corner's weight by the point's position."""
    weights = [end_of(cell, end)[1] for cell, end in zip(cells, ends, strict=True)]
    resolution = np.array(levels.resolutions, np.float32)[:, None]
    slopes = []
    for axis, end in enumerate(ends):
        a, b = (weight for other, weight in enumerate(weights) if other != axis)
        slopes.append((2 * end - 1) * resolution * a * b)
    return jnp.stack(slopes)


@functools.partial(jax.custom_vjp, nondiff_argnums=(2, 3))
def look_up(table, points, levels: Levels, moving=False):
    """Trilinear interpolation [levels, n, features] of table [rows, features].

    Differentiable in the table and, where the points are `moving`, in these: only
    cameras that are learnt need it, and it costs the table's rows once more. Without,
    their gradient is zero (the sampling along a ray is not differentiated).
    """
    cells, total = cells_of(points, levels), 0.0
    for ends in CORNERS:
        row, weight = corner_of(cells, ends, levels)
        total = total + weight[..., None] * table.at[row].get(mode="promise_in_bounds")
    return total


def _look_up_forward(table, points, levels, moving):
    features = look_up(table, points, levels, moving)
    return features, (points, table if moving else table.shape)


def _look_up_backward(levels, moving, residuals, found_grad):
    points, table = residuals
    shape = table.shape if moving else table
    cells = cells_of(points, levels)

    def of_corner(ends):
        row, weight = corner_of(cells, ends, levels)
        update = weight[..., None] * found_grad
        if not moving:
            return row, update, None
        value = table.at[row].get(mode="promise_in_bounds")
        along = jnp.sum(value * found_grad, axis=-1)
        return row, update, jnp.sum(slopes_of(cells, ends, levels) * along[None], 1)

    def add(grads, row, update, slope):
        grad, of_points = grads
        update = update.reshape(-1, shape[1])
        grad = grad.at[row.reshape(-1)].add(update, mode="promise_in_bounds")
        return grad, of_points + slope if moving else None

    start = jnp.zeros(shape, found_grad.dtype), 0.0 * points if moving else None
    if not calls.on_cpu():
        row, update, slope = jax.vmap(of_corner)(CORNERS)
        return add(start, row, update, jnp.sum(slope, axis=0) if moving else None)
    # One buffer takes every corner's updates in place. Autodiff would write a zero
    # table for each corner and their sum; an unrolled loop would compute the rows
    # inside the scatter, one by one: both are four times slower on a CPU. All corners'
    # rows made before the loop leave its caches: a third slower.
    grads, _ = jax.lax.scan(
        lambda grads, ends: (add(grads, *of_corner(ends)), None), start, CORNERS
    )
    return grads


look_up.defvjp(_look_up_forward, _look_up_backward)


def features_of(table, points, share, levels: Levels, *, moving, native):
    """What is looked up, times its share [levels, n]: [levels * features, n].

    moving: as of `look_up`. native: whether the kernels are there.
    """
    if native:
        return calls.look_up(table, points, share, levels, moving)
    features = look_up(table, points, levels, moving) * share[..., None]
    return jnp.moveaxis(features, -1, 1).reshape(-1, points.shape[1])


def shares_of(sigma, levels: Levels):
    """How much [levels, n] each level tells of Gaussians of radius `sigma` [n].

    A cell much smaller than the Gaussian tells it nothing.
    """
    cells = sigma[None] * np.array(levels.resolutions, np.float32)[:, None]
    return jax.scipy.special.erf(1 / (np.float32(np.sqrt(8)) * cells))


def table_init(key, shape):
    """Uniform +-1e-4: close to nothing, so that the first colours are grey."""
    return jax.random.uniform(key, shape, minval=-1e-4, maxval=1e-4)


class Grid(nn.Module):
    """Hash-grid features into small MLPs for density and values.

    `entries` per level is a power of two given by its logarithm.
    """

    levels: int = 6
    log2_hashmap_size: int = 17
    features: int = 4
    base_resolution: int = 16
    max_resolution: int = 1024
    anti_aliased: bool = True
    width: int = 64
    bottleneck: int = 15
    view_widths: tuple[int, ...] = (64,)
    outputs: int = 3
    precision: str = "float32"
    # Whether the points have a gradient, see `look_up`.
    moving: bool = False
    # Whether the kernels are there, see `alignerf.kernels`.
    native: bool = False

    @nn.compact
    def __call__(self, gaussians, viewdirs=None, fineness=None):
        mean, radius = coord.contract_spheres(gaussians)
        levels = Levels.geometric(
            self.levels,
            self.base_resolution,
            self.max_resolution,
            2**self.log2_hashmap_size,
        )
        points = mean.reshape(-1, 3).T / (2 * EXTENT) + 0.5
        sigma = radius.reshape(-1) / (2 * EXTENT)
        table = self.param("table", table_init, (sum(levels.entries), self.features))
        share = jnp.ones((self.levels, sigma.size))
        if self.anti_aliased:
            share = shares_of(sigma, levels)
        if fineness is not None:
            share = share * shading.fine_weights(fineness, self.levels)[:, None]
        how = {"moving": self.moving, "native": self.native}
        x = features_of(table, points, share, levels, **how)
        x = nn.relu(shading.Dense(self.width, self.precision)(x))
        width = 1 + (0 if viewdirs is None else self.bottleneck)
        x = shading.Dense(width, self.precision)(x)
        density = shading.density_of(x[0]).reshape(radius.shape)
        if viewdirs is None:
            return density, None
        head = shading.Shading(
            self.view_widths, self.outputs, self.precision, name="head"
        )
        return density, head(x[1:], viewdirs).reshape(-1, *radius.shape)
