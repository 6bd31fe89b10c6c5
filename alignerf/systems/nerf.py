"""NeRF (arXiv 2003.08934) as a system of the config."""

from typing import ClassVar, Literal

from alignerf.experiment.keys.key import key
from alignerf.systems import base


class NerfSystem(base.System):
    """NeRF as published: two networks of points, without contraction."""

    order: ClassVar = 1
    NETWORKS: ClassVar = 2

    kind: Literal["nerf"] = key(
        "nerf", "NeRF: points, two networks; learns at 0.001 to 0.0001"
    )
    near: float = key(0.2, base.NEAR, above=0, most=1e6)
    far: float = key(100.0, "farthest distance", above=0, most=100)
    samples: list[int] = base.two_looks(64, 128)
    spacing: Literal["linear", "inverse"] = key("inverse", base.SPACING)
    degrees: int = key(10, "of the encoding", least=1, most=16)
    width: int = key(256, "channels", least=1, most=16384)
    depth: int = key(8, "layers", least=1, most=64)
    noise: float = key(
        1.0, "standard deviation of noise on raw densities", least=0, most=100
    )
    background: Literal["black", "white"] = key("black", base.BEHIND)
    precision: base.PRECISIONS = key("float32", base.PRECISION)

    @property
    def points_a_ray(self):
        return self.samples[0] + sum(self.samples)

    def made(self, parts, **options):
        network = {
            "width": self.width,
            "depth": self.depth,
            "bottleneck": self.width,
            "view_width": max(self.width // 2, 1),
            "precision": self.precision,
        }
        model = parts.nerf.Nerf(
            coarse=parts.radiance.Radiance(**network),
            fine=parts.radiance.Radiance(**network),
            samples=tuple(self.samples),
            near=self.near,
            far=self.far,
            spacing=self.spacing,
            degrees=self.degrees,
            noise=self.noise,
            background=self.background,
        )
        return model, parts.rendering.squared(coarse=1.0)


SYSTEM = NerfSystem
