"""Mip-NeRF (arXiv 2103.13415) as a system of the config."""

from typing import ClassVar, Literal

from alignerf.experiment.keys.key import key
from alignerf.systems import base


class MipNerfSystem(base.System):
    """Mip-NeRF as published: one network of Gaussians, without contraction."""

    order: ClassVar = 2
    kind: Literal["mipnerf"] = key(
        "mipnerf", "mip-NeRF: Gaussians, one network; learns at 0.001 to 0.0001"
    )
    near: float = key(0.2, base.NEAR, above=0, most=1e6)
    far: float = key(100.0, "farthest distance", above=0, most=1e6)
    samples: list[int] = key(
        [128, 128],
        "intervals a ray in the first look, and in the second",
        least=2,
        most=4096,
        length=(2, 2),
    )
    spacing: Literal["linear", "inverse"] = key("inverse", base.SPACING)
    degrees: int = key(16, "of the encoding", least=1, most=16)
    anti_aliased: bool = key(
        True,
        "true: the encoding fades what is finer than a sample's Gaussian; false: a "
        "sample is a point, the Gaussian's mean",
    )
    width: int = key(256, "channels; 1024 in the bigger one", least=1, most=16384)
    depth: int = key(8, "layers", least=1, most=64)
    bottleneck: int = key(256, "numbers to the head", least=1, most=16384)
    view_width: int = key(128, "of the head's layer", least=1, most=16384)
    background: Literal["black", "white"] = key("black", base.BEHIND)
    precision: base.PRECISIONS = key("float32", base.PRECISION)

    def made(self, parts, **options):
        network = parts.radiance.Radiance(
            width=self.width,
            depth=self.depth,
            bottleneck=self.bottleneck,
            view_width=self.view_width,
            padding=parts.mipnerf.PADDING,
            precision=self.precision,
        )
        model = parts.mipnerf.MipNerf(
            network=network,
            samples=tuple(self.samples),
            near=self.near,
            far=self.far,
            spacing=self.spacing,
            degrees=self.degrees,
            anti_aliased=self.anti_aliased,
            background=self.background,
        )
        return model, parts.rendering.squared(coarse=parts.mipnerf.COARSE)


SYSTEM = MipNerfSystem
