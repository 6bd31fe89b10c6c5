"""Mip-NeRF (arXiv 2103.13415): Gaussians instead of points, one network for both looks.

128 intervals from near to far; their weights, blurred, say where 128 others go; the
same network sees both. A Gaussian stands for each piece of the cone of a pixel, and its
encoding fades what is finer than it is (not so without `anti_aliased`, where the mean
alone counts). The loss of the first look counts a tenth.
"""

import flax.linen as nn
import jax

from alignerf.fields import encoding
from alignerf.mipnerf360 import coord, model, render
from alignerf.rays import sampling

DENSITY_BIAS, PADDING, COARSE = -1.0, 0.001, 0.1


class MipNerf(nn.Module):
    """What a ray shows, by one network of Gaussians."""

    network: nn.Module
    samples: tuple[int, int]
    near: float
    far: float
    spacing: str
    degrees: int
    anti_aliased: bool
    background: str

    @property
    def edges(self):
        """Edges of the intervals of both looks."""
        return tuple(count + 1 for count in self.samples)

    @property
    def jitters(self):
        """Random numbers that a ray takes: one for each edge."""
        return sum(self.edges)

    def __call__(self, rays, *, jitter=None):
        first, last = self.edges
        places, again = sampling.split_jitter(jitter, self.edges)
        count = len(rays.origins)
        t = sampling.stratified(places, self.near, self.far, count, first, self.spacing)
        weights, coarse, _ = self.look(rays, t)
        t = sampling.sample_pdf(again, t, sampling.blurred(weights), last)
        _, values, depth = self.look(rays, t)
        return model.Rendering(values, depth, coarse=(coarse,))

    def look(self, rays, t):
        """(weights, colours, depth) of the intervals between edges t."""
        gaussians = render.cast_cones(t, rays.origins, rays.directions, rays.radii)
        if not self.anti_aliased:
            gaussians = coord.points(gaussians)
        encoded = encoding.integrated_axes(gaussians, self.degrees)
        raw, colours = self.network(encoded, rays.viewdirs)
        density = jax.nn.softplus(raw.reshape(gaussians.t_std.shape) + DENSITY_BIAS)
        length = sampling.lengths(t, rays.directions, 0.0)[..., :-1]
        weights, passed = sampling.weights_of(density, length)
        values = sampling.integrate(weights, colours)
        values = sampling.before(self.background, values, passed)
        return weights, values, render.median_distance(weights, t)
