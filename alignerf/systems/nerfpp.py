"""NeRF++ (arXiv 2010.07492) as a system of the config."""

from typing import ClassVar, Literal

from alignerf.experiment.keys.key import key
from alignerf.systems import base


class NerfPlusPlus(base.System):
    """NeRF++ as published: a sphere inside out, two networks for either part."""

    order: ClassVar = 3
    NETWORKS: ClassVar = 4

    kind: Literal["nerfpp"] = key(
        "nerfpp", "NeRF++: inside and outside of a sphere; learns at 0.001 to 0.0001"
    )
    near: float = key(0.01, base.NEAR, above=0, most=0.9)
    radius: float = key(
        1.75,
        "of the sphere, in units of the largest camera coordinate: over the root of 3, "
        "so that all cameras lie in it",
        above=1.7321,
        most=100,
    )
    samples: list[int] = base.two_looks(64, 128)
    degrees: int = key(10, "of the encoding", least=1, most=16)
    width: int = key(
        256,
        "channels; 512 in the bigger one, whose view_width is 256",
        least=1,
        most=16384,
    )
    depth: int = key(8, "layers", least=1, most=64)
    bottleneck: int = key(256, "numbers to the head", least=1, most=16384)
    view_width: int = key(128, "of the head's layer", least=1, most=16384)
    precision: base.PRECISIONS = key("float32", base.PRECISION)

    @property
    def points_a_ray(self):
        return 2 * (self.samples[0] + sum(self.samples))

    def made(self, parts, **options):
        network = {
            "width": self.width,
            "depth": self.depth,
            "bottleneck": self.bottleneck,
            "view_width": self.view_width,
            "precision": self.precision,
        }
        pairs = [
            tuple(parts.radiance.Radiance(**network) for _ in range(2))
            for _ in range(2)
        ]
        model = parts.nerfpp.NerfPlusPlus(
            inside=pairs[0],
            outside=pairs[1],
            samples=tuple(self.samples),
            near=self.near,
            radius=self.radius,
            degrees=self.degrees,
        )
        return model, parts.rendering.squared(coarse=1.0)


SYSTEM = NerfPlusPlus
