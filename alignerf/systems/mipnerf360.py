"""Mip-NeRF 360 (arXiv 2111.12077) as a system of the config, and its fields' keys."""

from typing import Annotated, ClassVar, Literal

import pydantic

from alignerf.experiment.keys.key import Keys, key
from alignerf.systems import base

OF_PROPOSAL = 1024
# Of a field that contracts nothing, in units of the largest camera coordinate.
MAX_FAR = 100


# The fields' learning rates, as the systems', were chosen on courtyard, seed 1.


class Grid(Keys):
    """A hash grid; its defaults are those of `alignerf.fields.grid`."""

    RATES: ClassVar = (0.03, 0.003)

    kind: Literal["grid"] = key("grid", "a hash grid, fast; learns at 0.03 to 0.003")
    levels: int = key(6, "resolutions", least=1, most=32)
    log2_hashmap_size: int = key(
        17, "log2 of the table's rows per level", least=4, most=26
    )
    features: int = key(4, "numbers a row", least=1, most=64)
    base_resolution: int = key(16, "cells a side", least=2, most=2**20)
    max_resolution: int | None = key(
        None,
        f"cells a side; null: {base.USUAL['max_resolution']}, or what `decide` makes "
        f"of it, of a proposal {OF_PROPOSAL}",
        least=2,
        most=2**20,
    )
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
    precision: base.PRECISIONS = key("float32", base.PRECISION)


class Mlp(Keys):
    """The published field; its defaults are those of `alignerf.fields.mlp`."""

    RATES: ClassVar = (0.01, 0.001)

    kind: Literal["mlp"] = key("mlp", "as published; learns at 0.01 to 0.001")
    width: int = key(1024, "channels (the paper's c)", least=1, most=16384)
    depth: int = key(8, "layers", least=1, most=64)
    skip_every: int = key(4, "layers between skips", least=1, most=64)
    degrees: int = key(12, "of the encoding", least=1, most=16)
    bottleneck: int = key(256, "numbers to the head", least=1, most=16384)
    view_width: int = key(128, "of the head's layer", least=1, most=16384)
    precision: base.PRECISIONS = key("float32", base.PRECISION)


class Nerf(Keys):
    """NeRF's field, as BARF has it; its defaults are those of `alignerf.fields.nerf`.

    Without contraction: the model's `far` bounds what it sees.
    """

    RATES: ClassVar = (0.001, 0.0001)

    kind: Literal["nerf"] = key(
        "nerf", "of points in a bounded scene, as BARF's; learns at 0.001 to 0.0001"
    )
    width: int = key(256, "channels", least=1, most=16384)
    depth: int = key(8, "layers", least=1, most=64)
    skip_after: int = key(4, "layers before the point comes in again", least=1, most=64)
    degrees: int = key(10, "of the encoding", least=1, most=16)
    view_degrees: int = key(4, "of the view direction's encoding", least=1, most=16)
    view_width: int = key(128, "of the head's layer", least=1, most=16384)
    precision: base.PRECISIONS = key("float32", base.PRECISION)


FIELD = (
    "with `kind` the defaults of that kind; without it, changes of the default field"
)
BY_KIND = pydantic.Field(discriminator="kind")


class Model(base.System):
    """A mip-NeRF 360: how rays are sampled, and the two fields."""

    # Its kind may be left out.
    model_config = pydantic.ConfigDict(json_schema_extra={})
    order: ClassVar = 0
    HAS_NO: ClassVar = ()

    kind: Literal["mipnerf360"] = key("mipnerf360", "proposals, in contracted space")
    near: float | None = key(
        None,
        f"{base.NEAR}; null: {base.USUAL['near']:g}, or what `decide` makes of it",
        above=0,
        most=1e6,
    )
    far: float = key(1e6, "farthest distance", above=0, most=1e18)
    radius: float | None = key(
        None,
        "of the ball that is not contracted, in units of the largest camera "
        f"coordinate; null: {base.USUAL['radius']:g}, or what `decide` makes of it",
        above=0,
        most=1e6,
    )
    samples: list[int] = key(
        [32, 16, 12],
        "samples a ray in each proposal round, and in the last round; a single number "
        "takes them evenly in 1 / distance, without a proposal",
        least=1,
        most=4096,
        length=(1, 8),
    )
    background: Literal["black", "white"] | None = key(None, base.BEHIND_OR_OPAQUE)
    proposal: Annotated[Grid | Mlp, BY_KIND] = key(
        Grid(levels=4, log2_hashmap_size=15, features=2, max_resolution=256, width=16),
        FIELD,
    )
    field: Annotated[Grid | Mlp | Nerf, BY_KIND] = key(Grid, FIELD)

    @pydantic.field_validator("proposal", "field", mode="before")
    @classmethod
    def on_default(cls, value, about):
        """Without a kind, the default field with these changes."""
        if isinstance(value, dict) and "kind" not in value:
            return cls.default(about.field_name).model_dump() | value
        return value

    @property
    def open(self):
        # Only a grid has cells; a field of points contracts nothing.
        parts = {"near": self, "max_resolution": self.field}
        parts |= {"radius": self} if self.field.kind != "nerf" else {}
        return [
            name for name in base.USUAL if getattr(parts.get(name), name, 0) is None
        ]

    def closed(self, values):
        values, found = base.USUAL | values, {}
        for name in ("near", "radius"):
            if getattr(self, name) is None:
                found[name] = values[name]
        for name, cells in (
            ("field", values["max_resolution"]),
            ("proposal", OF_PROPOSAL),
        ):
            if getattr(part := getattr(self, name), "max_resolution", 0) is None:
                found[name] = part.model_copy(update={"max_resolution": cells})
        return self.model_copy(update=found)

    @property
    def rates(self):
        return self.field.RATES

    @property
    def squares_errors(self):
        """Whether it learns from squared errors alone.

        As BARF does, and where the background is known: by Charbonnier's loss, whose
        best constant is the median, an object before white was taken for all white.
        """
        return self.field.kind == "nerf" or self.background is not None

    @property
    def has_no(self):
        return ("distortion_weight",) if self.squares_errors else ()

    @property
    def sized(self):
        return {"proposal": self.proposal, "field": self.field}

    def faults(self):
        yield from super().faults()
        if self.field.kind == "nerf" and self.far > MAX_FAR:
            # Sines of distant points are noise, and nothing contracts them.
            yield "far", f"field nerf sees no farther than {MAX_FAR}"
        for name in {*self.has_no} & {*self.training.given}:
            yield f"training.{name}", "none with field nerf, or with a background"

    def made(self, parts, *, native, moving, **of_field):
        """of_field: what else the field is made with, as `outputs`."""

        def field(chosen, moving=False, **options):
            # Other fields look nothing up.
            lookups = {"native": native} | ({"moving": True} if moving else {})
            options |= lookups if chosen.kind == "grid" else {}
            for name, value in (chosen.model_dump() | options).items():
                options[name] = tuple(value) if isinstance(value, list) else value
            return parts.fields.make(**options)

        model = parts.mipnerf360.Model(
            proposal=field(self.proposal) if self.has_proposals else None,
            field=field(self.field, moving, **of_field),
            samples=tuple(self.samples),
            near=self.near,
            far=self.far,
            radius=self.radius,
            background=self.background,
            native=native,
        )
        if self.squares_errors:
            return model, parts.rendering.squared()
        return model, parts.rendering.charbonnier


SYSTEM = Model
