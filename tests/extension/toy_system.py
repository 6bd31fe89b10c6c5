"""A toy system: one network of points, looked at once along each ray."""

from typing import Literal

import flax.linen as nn

from alignerf.experiment.keys.key import key
from alignerf.experiment.keys.system import System, changes
from alignerf.experiment.keys.training import Changes
from alignerf.fields import encoding, radiance
from alignerf.systems import rendering, sampling


class Keys(System):
    """Its keys, and what suits it."""

    kind: Literal["one_look"] = key("one_look", "one network, one look")
    near: float = key(0.2, "nearest distance", above=0, most=1e6)
    far: float = key(20.0, "farthest distance", above=0, most=100)
    samples: list[int] = key([16], "points a ray", least=2, most=4096, length=(1, 1))
    width: int = key(16, "channels", least=1, most=16384)
    depth: int = key(2, "layers", least=1, most=64)
    training: Changes = changes()


class OneLook(nn.Module):
    """What a ray shows."""

    network: nn.Module
    samples: int
    near: float
    far: float

    @property
    def jitters(self):
        """Random numbers that a ray takes."""
        return self.samples

    def __call__(self, rays, *, jitter=None):
        bounds = (self.near, self.far, len(rays.origins), self.samples, "inverse")
        t = sampling.stratified(jitter, *bounds)
        x = sampling.points_of(t, rays.origins, rays.directions)
        raw, colours = self.network(encoding.positional(x, 6), rays.viewdirs)
        length = sampling.lengths(t, rays.directions, sampling.ENDLESS)
        density = nn.softplus(raw.reshape(t.shape))
        weights, _ = sampling.weights_of(density, length)
        values = sampling.integrate(weights, colours)
        return rendering.Rendering(values, rendering.depth_of(weights, t))


def make(chosen):
    """The system of these keys, and its loss."""
    network = radiance.Radiance(
        width=chosen.width,
        depth=chosen.depth,
        bottleneck=chosen.width,
        view_width=chosen.width,
        precision="float32",
    )
    model = OneLook(network, chosen.samples[0], chosen.near, chosen.far)
    return model, rendering.squared()
