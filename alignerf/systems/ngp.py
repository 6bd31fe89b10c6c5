"""Instant-NGP (arXiv 2201.05989): a hash grid in a box, learnt within minutes.

The grid's rows and two small networks say what a point is like. Its own sampler marches
through a grid of what is occupied; here proposals find the samples, as in mip-NeRF 360
(docs/evidence/reproduction.md says why). The loss is Huber's.
"""

from typing import ClassVar, Literal

from alignerf.experiment.keys.key import key
from alignerf.systems import base

# A side in cells: its third power is a 64-bit number.
MAX_CELLS = 2**20


class InstantNgp(base.System):
    """Instant-NGP's field as published; proposals find the samples."""

    order: ClassVar = 4
    RATES: ClassVar = (0.03, 0.003)
    HAS_NO: ClassVar = ("distortion_weight",)

    kind: Literal["ngp"] = key(
        "ngp", "Instant-NGP: a hash grid in a box; learns at 0.03 to 0.003"
    )
    near: float = key(0.2, base.NEAR, above=0, most=1e6)
    far: float = key(64.0, "farthest distance", above=0, most=1e6)
    side: float = key(
        32.0, "of the box, in units of the largest camera coordinate", above=0, most=128
    )
    samples: list[int] = key(
        [64, 32],
        "samples a ray in each proposal round, and in the last round",
        least=1,
        most=4096,
        length=(1, 8),
    )
    levels: int = key(16, "resolutions", least=1, most=32)
    log2_hashmap_size: int = key(
        21, "log2 of the table's rows a level", least=4, most=26
    )
    features: int = key(2, "numbers a row", least=1, most=64)
    base_resolution: int = key(16, "corners a side", least=2, most=2**16)
    max_resolution: int = key(
        2048, "cells over a length of 1 in the box", least=2, most=2**16
    )
    width: int = key(64, "of the networks", least=1, most=16384)
    background: Literal["black", "white"] | None = key(None, base.BEHIND_OR_OPAQUE)
    precision: base.PRECISIONS = key("float32", base.PRECISION)

    def faults(self):
        yield from super().faults()
        cells, least = self.max_resolution * self.side, self.base_resolution + 1
        if not self.base_resolution < cells <= MAX_CELLS:
            over = f"{cells:g} cells over the box are not from"
            yield "max_resolution", f"{over} {least} to {MAX_CELLS}"

    def made(self, parts, *, native, moving):
        shared = {"side": self.side, "base_resolution": self.base_resolution}
        shared |= {"moving": moving, "native": native}
        field = parts.box.Box(
            levels=self.levels,
            log2_hashmap_size=self.log2_hashmap_size,
            features=self.features,
            max_resolution=self.max_resolution,
            width=self.width,
            precision=self.precision,
            **shared,
        )
        # A half of the levels, a quarter of the rows: enough to say where to look.
        proposal = parts.box.Box(
            levels=max(self.levels // 2, 1),
            max_resolution=max(self.max_resolution // 8, self.base_resolution),
            log2_hashmap_size=max(self.log2_hashmap_size - 2, 4),
            features=self.features,
            width=max(self.width // 4, 1),
            precision=self.precision,
            **shared,
        )
        model = parts.mipnerf360.Model(
            proposal=proposal if len(self.samples) > 1 else None,
            field=field,
            samples=tuple(self.samples),
            near=self.near,
            far=self.far,
            background=self.background,
            native=native,
        )
        return model, parts.rendering.huber


SYSTEM = InstantNgp
