"""Keys of `models`: how rays are sampled, and by which field."""

from typing import Annotated, ClassVar, Literal, Union

import pydantic

from alignerf.experiment.keys.fields import PRECISION, PRECISIONS, Grid, Mlp, Nerf
from alignerf.experiment.keys.key import Keys, key, left_to_facts
from alignerf.experiment.keys.system import System, changes
from alignerf.experiment.keys.training import RATES, Changes
from alignerf.files.environment import extensions

FIELD = (
    "with `kind` the defaults of that kind; without it, changes of the default field"
)


BY_KIND = pydantic.Field(discriminator="kind")


# What `decide` leaves to a scene's facts: `experiment.decisions` has a rule for each.
OPEN_OF_MODEL = ("near", "radius", "finest")


BEHIND = "colour of what lies behind a ray's last sample: black, or white"
BEHIND_OR_OPAQUE = (
    f"{BEHIND}; null: the scene's own `background`, else unknown: a ray ends opaque. A "
    "mip-NeRF 360 with one learns from squared errors, without distortion_weight"
)


class Model(Keys):
    """A mip-NeRF 360: how rays are sampled, and the two fields."""

    kind: Literal["mipnerf360"] = key("mipnerf360", "proposals, in contracted space")
    near: float = key(
        0.2,
        "nearest distance, in units of the largest camera coordinate",
        above=0,
        most=1e6,
    )
    far: float = key(1e6, "farthest distance", above=0, most=1e18)
    radius: float = key(
        1.0,
        "of the ball that is not contracted, in units of the largest camera coordinate",
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
    background: Literal["black", "white"] | None = key(None, BEHIND_OR_OPAQUE)
    proposal: Annotated[Grid | Mlp, BY_KIND] = key(
        Grid(levels=4, log2_entries=15, features=2, finest=256, width=16), FIELD
    )
    field: Annotated[Grid | Mlp | Nerf, BY_KIND] = key(Grid(finest=2048), FIELD)
    training: Changes = changes()
    decided: list[Literal[OPEN_OF_MODEL]] = left_to_facts(*OPEN_OF_MODEL)

    @pydantic.field_validator("proposal", "field", mode="before")
    @classmethod
    def on_default(cls, value, about):
        """Without a kind, the default field with these changes."""
        if isinstance(value, dict) and "kind" not in value:
            return cls.default(about.field_name).model_dump() | value
        return value

    @property
    def points_a_ray(self):
        """Points of a ray that its fields see in a training."""
        return sum(self.samples)


NEAR = "nearest distance, in units of the largest camera coordinate"
TWO_LOOKS = "samples a ray in the first look, and more in the second"
SPACING = (
    "of the first look's samples: inverse, in 1 / distance, for scenes without a bound"
)


def samples(*default):
    # The first and last of a look's points have no part in the second's.
    return key([*default], TWO_LOOKS, least=3, most=4096, length=(2, 2))


class NerfSystem(System):
    """NeRF as published: two networks of points, without contraction."""

    NETWORKS: ClassVar = 2

    kind: Literal["nerf"] = key("nerf", "NeRF: points, two networks")
    near: float = key(0.2, NEAR, above=0, most=1e6)
    far: float = key(100.0, "farthest distance", above=0, most=100)
    samples: list[int] = samples(64, 128)
    spacing: Literal["linear", "inverse"] = key("inverse", SPACING)
    degrees: int = key(10, "of the encoding", least=1, most=16)
    width: int = key(256, "channels", least=1, most=16384)
    depth: int = key(8, "layers", least=1, most=64)
    noise: float = key(
        1.0, "standard deviation of noise on raw densities", least=0, most=100
    )
    background: Literal["black", "white"] = key("black", BEHIND)
    precision: PRECISIONS = key("float32", PRECISION)
    training: Changes = changes()

    @property
    def points_a_ray(self):
        return self.samples[0] + sum(self.samples)


class MipNerfSystem(System):
    """Mip-NeRF as published: one network of Gaussians, without contraction."""

    kind: Literal["mipnerf"] = key("mipnerf", "mip-NeRF: Gaussians, one network")
    near: float = key(0.2, NEAR, above=0, most=1e6)
    far: float = key(100.0, "farthest distance", above=0, most=1e6)
    samples: list[int] = key(
        [128, 128],
        "intervals a ray in the first look, and in the second",
        least=2,
        most=4096,
        length=(2, 2),
    )
    spacing: Literal["linear", "inverse"] = key("inverse", SPACING)
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
    background: Literal["black", "white"] = key("black", BEHIND)
    precision: PRECISIONS = key("float32", PRECISION)
    training: Changes = changes()


class NerfPlusPlus(System):
    """NeRF++ as published: a sphere inside out, two networks for either part."""

    NETWORKS: ClassVar = 4

    kind: Literal["nerfpp"] = key("nerfpp", "NeRF++: inside and outside of a sphere")
    near: float = key(0.01, NEAR, above=0, most=0.9)
    radius: float = key(
        1.75,
        "of the sphere, in units of the largest camera coordinate: over the root of 3, "
        "so that all cameras lie in it",
        above=1.7321,
        most=100,
    )
    samples: list[int] = samples(64, 128)
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
    precision: PRECISIONS = key("float32", PRECISION)
    training: Changes = changes()

    @property
    def points_a_ray(self):
        return 2 * (self.samples[0] + sum(self.samples))


class InstantNgp(System):
    """Instant-NGP's field as published; proposals find the samples."""

    HAS_NO: ClassVar = ("distortion_weight",)

    kind: Literal["ngp"] = key("ngp", "Instant-NGP: a hash grid in a box")
    near: float = key(0.2, NEAR, above=0, most=1e6)
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
    log2_entries: int = key(21, "log2 of the table's rows a level", least=4, most=26)
    features: int = key(2, "numbers a row", least=1, most=64)
    coarsest: int = key(16, "corners a side", least=2, most=2**16)
    finest: int = key(2048, "cells over a length of 1 in the box", least=2, most=2**16)
    width: int = key(64, "of the networks", least=1, most=16384)
    background: Literal["black", "white"] | None = key(None, BEHIND_OR_OPAQUE)
    precision: PRECISIONS = key("float32", PRECISION)
    training: Changes = changes()


def of_usual_kind(value):
    """Without a kind a model is a mip-NeRF 360."""
    if isinstance(value, dict):
        return {"kind": Model.default("kind")} | value
    return value


SYSTEMS = (NerfSystem, MipNerfSystem, NerfPlusPlus, InstantNgp)
KINDS = {kind.default("kind"): kind for kind in (Model, *SYSTEMS)}
OF_OTHERS = {
    system.Keys.default("kind"): system.Keys
    for system in extensions.of_group("systems").values()
}
extensions.check_new("systems", OF_OTHERS, KINDS)
KINDS |= OF_OTHERS
Models = Annotated[
    Union[tuple(KINDS.values())],  # noqa: UP007 (of a tuple)
    BY_KIND,
    pydantic.BeforeValidator(of_usual_kind),
]


def field_kind(model):
    """What decides a model's learning rates and memory, of a mapping with defaults."""
    return model["field"]["kind"] if "field" in model else model["kind"]


def rates_of(model):
    """First and last learning rate that suit a model, of a mapping with defaults."""
    kind = field_kind(model)
    return list(RATES[kind] if kind in RATES else KINDS[kind].RATES)


def squares_errors(model):
    """Whether a mip-NeRF 360 learns from squared errors alone, of a mapping.

    As BARF does, and where the background is known: by Charbonnier's loss, whose best
    constant is the median, an object before white was taken for all white.
    """
    return model["field"]["kind"] == "nerf" or model["background"] is not None
