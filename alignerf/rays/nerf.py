"""NeRF (arXiv 2003.08934): points of a ray, sines of a point, two networks.

64 points from near to far; a first network's weights say where 128 more go; a second
network sees all 192. Both learn from the squared error of their colour. As in its code
(bmild/nerf) densities are max(0, x), with noise while they are learnt, and behind the
last point the ray is opaque as soon as that has a density.
"""

import flax.linen as nn
import jax

from alignerf.fields import encoding
from alignerf.mipnerf360 import model
from alignerf.rays import rendering, sampling


class Nerf(nn.Module):
    """What a ray shows, by two networks of points."""

    coarse: nn.Module
    fine: nn.Module
    samples: tuple[int, int]
    near: float
    far: float
    spacing: str
    degrees: int
    noise: float
    background: str

    @property
    def jitters(self):
        """Random numbers that a ray takes."""
        return sum(self.parts)

    @property
    def parts(self):
        """Random numbers by use: places of points in both looks, noise in both."""
        first, more = self.samples
        noises = (first, first + more) if self.noise else (0, 0)
        return (first, more, *noises)

    def __call__(self, rays, *, jitter=None):
        first, more = self.samples
        places, again, *noises = sampling.split_jitter(jitter, self.parts)
        count = len(rays.origins)
        t = sampling.stratified(places, self.near, self.far, count, first, self.spacing)
        weights, coarse, _ = self.look(self.coarse, rays, t, noises[0])
        t = sampling.fine_samples(again, t, weights, more)
        weights, values, depth = self.look(self.fine, rays, t, noises[1])
        return model.Rendering(values, depth, coarse=(coarse,))

    def look(self, network, rays, t, noise):
        """(weights, colours, depth) of the points at t by a network."""
        x = sampling.points_of(t, rays.origins, rays.directions)
        raw, colours = network(encoding.positional(x, self.degrees), rays.viewdirs)
        raw = sampling.with_noise(raw.reshape(t.shape), noise, self.noise)
        length = sampling.lengths(t, rays.directions, sampling.ENDLESS)
        weights, passed = sampling.weights_of(jax.nn.relu(raw), length)
        values = sampling.integrate(weights, colours)
        values = sampling.before(self.background, values, passed)
        return weights, values, rendering.depth_of(weights, t)
