"""Keys of a model's fields: hash grids, and networks as published."""

from typing import Literal

from alignerf.experiment.keys.key import Keys, key

PRECISIONS = Literal["float32", "bfloat16"]
PRECISION = (
    "of the layers and what passes between them; positions, encodings, densities, "
    "colours, parameters and all sums along a ray are float32"
)


class Grid(Keys):
    """A hash grid; its defaults are those of `alignerf.fields.grid`."""

    kind: Literal["grid"] = key("grid", "a hash grid, fast")
    levels: int = key(6, "resolutions", least=1, most=32)
    log2_entries: int = key(17, "log2 of the table's rows per level", least=4, most=26)
    features: int = key(4, "numbers a row", least=1, most=64)
    coarsest: int = key(16, "cells a side", least=2, most=2**20)
    finest: int = key(1024, "cells a side", least=2, most=2**20)
    anti_aliased: bool = key(
        True,
        "true: cells much smaller than what a sample stands for tell it nothing, as in "
        "zip-NeRF; false: a sample is a point, as in Instant-NGP",
    )
    width: int = key(64, "of the density layer", least=1, most=16384)
    bottleneck: int = key(15, "numbers to the head", least=1, most=16384)
    view_widths: list[int] = key(
        [64], "widths of the head's layers", least=1, most=16384, length=(0, 16)
    )
    precision: PRECISIONS = key("float32", PRECISION)


class Mlp(Keys):
    """The published field; its defaults are those of `alignerf.fields.mlp`."""

    kind: Literal["mlp"] = key("mlp", "as published")
    width: int = key(1024, "channels (the paper's c)", least=1, most=16384)
    depth: int = key(8, "layers", least=1, most=64)
    skip_every: int = key(4, "layers between skips", least=1, most=64)
    degrees: int = key(12, "of the encoding", least=1, most=16)
    bottleneck: int = key(256, "numbers to the head", least=1, most=16384)
    view_width: int = key(128, "of the head's layer", least=1, most=16384)
    precision: PRECISIONS = key("float32", PRECISION)


class Nerf(Keys):
    """NeRF's field, as BARF has it; its defaults are those of `alignerf.fields.nerf`.

    Without contraction: the model's `far` bounds what it sees.
    """

    kind: Literal["nerf"] = key("nerf", "of points in a bounded scene, as BARF's")
    width: int = key(256, "channels", least=1, most=16384)
    depth: int = key(8, "layers", least=1, most=64)
    skip_after: int = key(4, "layers before the point comes in again", least=1, most=64)
    degrees: int = key(10, "of the encoding", least=1, most=16)
    view_degrees: int = key(4, "of the view direction's encoding", least=1, most=16)
    view_width: int = key(128, "of the head's layer", least=1, most=16384)
    precision: PRECISIONS = key("float32", PRECISION)
