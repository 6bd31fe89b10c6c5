"""NeRF++ (arXiv 2010.07492): what is near within a sphere, what is far inside out.

Within the unit sphere, NeRF's points and networks. Outside, a point is its direction
and 1 / distance: four numbers in [-1, 1], with networks of their own. The foreground
hides the background as far as it is opaque. Two looks, each with its own pair of
networks, both trained by the squared error. Densities are |x|, as in its code
(Kai-46/nerfplusplus).
"""

import flax.linen as nn
import jax.numpy as jnp

from alignerf.fields import encoding, space
from alignerf.mipnerf360 import model
from alignerf.rays import rendering, sampling


class NerfPlusPlus(nn.Module):
    """What a ray shows, by a pair of networks for each of two looks."""

    inside: tuple[nn.Module, nn.Module]
    outside: tuple[nn.Module, nn.Module]
    samples: tuple[int, int]
    near: float
    radius: float  # of the sphere, in the scene's units
    degrees: int

    @property
    def jitters(self):
        """Random numbers that a ray takes, for the places of its points."""
        return sum(self.parts)

    @property
    def parts(self):
        """Random numbers by use: within and outside, of the first and second look."""
        first, more = self.samples
        return (first, first, more, more)

    def __call__(self, rays, *, jitter=None):
        first, more = self.samples
        places = sampling.split_jitter(jitter, self.parts)
        # In units of the sphere.
        rays = rays._replace(
            origins=rays.origins / self.radius, directions=rays.directions / self.radius
        )
        count = len(rays.origins)
        leave = space.sphere_exit(rays.origins, rays.directions, 1.0)
        leave = jnp.maximum(leave, 1.01 * self.near)
        t = sampling.stratified(places[0], self.near, leave, count, first)
        u = sampling.stratified(places[1], 0.0, 1.0, count, first)
        coarse, _, looked = self.look(0, rays, t, u, leave)
        t = sampling.fine_samples(places[2], t, looked[0], more)
        u = sampling.fine_samples(places[3], u, looked[1], more)
        values, depth, _ = self.look(1, rays, t, u, leave)
        return model.Rendering(values, depth, coarse=(coarse,))

    def look(self, number, rays, t, u, leave):
        """(colours, depth, weights of both parts) at t within, at 1 / r = u outside."""
        ends = jnp.concatenate([t[..., 1:], leave], axis=-1)
        length = (ends - t) * jnp.linalg.norm(rays.directions, axis=-1, keepdims=True)
        x = sampling.points_of(t, rays.origins, rays.directions)
        near_weights, passed, near_values = self.part(
            self.inside[number], x, rays, jnp.maximum(length, 0.0)
        )
        # From the sphere outwards 1 / r falls; behind the last point nothing ends.
        falling = u[..., ::-1]
        x = space.invert_sphere(falling, rays.origins, rays.directions)
        gaps = falling[..., :-1] - falling[..., 1:]
        gaps = jnp.concatenate(
            [gaps, jnp.full_like(u[..., :1], sampling.ENDLESS)], axis=-1
        )
        far_weights, _, far_values = self.part(
            self.outside[number], x.reshape(-1, 4).T, rays, gaps
        )
        values = near_values + passed[:, None] * far_values
        both = jnp.concatenate([near_weights, passed[:, None] * far_weights], axis=-1)
        # |x| is about t |d| out there.
        speed = jnp.linalg.norm(rays.directions, axis=-1, keepdims=True)
        far_t = 1.0 / jnp.maximum(falling, 1e-6) / speed
        depth = rendering.depth_of(both, jnp.concatenate([t, far_t], axis=-1))
        return values, depth, (near_weights, far_weights[..., ::-1])

    def part(self, network, x, rays, length):
        """(weights, what passes, colours) of one part of the rays."""
        raw, colours = network(encoding.positional(x, self.degrees), rays.viewdirs)
        weights, passed = sampling.weights_of(
            jnp.abs(raw.reshape(length.shape)), length
        )
        return weights, passed, sampling.integrate(weights, colours)
