"""A toy system: one network of points, looked at once along each ray."""

from typing import Literal

from alignerf.experiment.keys.key import key
from alignerf.systems import base


class OneLook(base.System):
    """Its keys, and what suits it."""

    kind: Literal["one_look"] = key("one_look", "one network, one look")
    near: float = key(0.2, "nearest distance", above=0, most=1e6)
    far: float = key(20.0, "farthest distance", above=0, most=100)
    samples: list[int] = key([16], "points a ray", least=2, most=4096, length=(1, 1))
    width: int = key(16, "channels", least=1, most=16384)
    depth: int = key(2, "layers", least=1, most=64)

    def made(self, parts, **options):
        field = parts.fields.make("nerf", width=self.width, depth=self.depth)
        samples = tuple(self.samples)
        model = parts.mipnerf360.Model(None, field, samples, self.near, self.far)
        return model, parts.rendering.squared()


SYSTEM = OneLook
