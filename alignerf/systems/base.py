"""What the systems have in common: a model of the config that says its kind."""

from typing import ClassVar, Literal

import pydantic

from alignerf.experiment.keys.key import Keys, key
from alignerf.experiment.keys.training import Changes

PRECISIONS = Literal["float32", "bfloat16"]
PRECISION = (
    "of the factors of the layers' products; their sums and all else are float32. "
    "bfloat16, as a TPU multiplies by default, is for accelerators"
)
NEAR = "nearest distance, in units of the largest camera coordinate"
SPACING = (
    "of the first look's samples: inverse, in 1 / distance, for scenes without a bound"
)
BEHIND = "color of what lies behind a ray's last sample: black, or white"
BEHIND_OR_OPAQUE = (
    f"{BEHIND}; null: the scene's own `background`, else unknown: a ray ends opaque. A "
    "mip-NeRF 360 with one learns from squared errors, without distortion_weight"
)
# Of keys that are null, where no scene's facts decide them.
USUAL = {"near": 0.2, "radius": 1.0, "max_resolution": 2048}
# What no machine is asked for: parameters and all of their training.
MAX_BYTES = 2**38


def two_looks(*default):
    """The key `samples` of a system that looks twice along a ray."""
    what = "samples a ray in the first look, and more in the second"
    # The first and last of a look's points have no part in the second's.
    return key([*default], what, least=3, most=4096, length=(2, 2))


class System(Keys):
    """A system's keys, and all that others ask of it; its `kind` is its name.

    order: its place among all. RATES: first and last learning rate where a config names
    none. HAS_NO: keys of a training that do nothing for it. NETWORKS: how many of its
    size it has.
    """

    model_config = pydantic.ConfigDict(json_schema_extra={"required": ["kind"]})
    order: ClassVar = 100
    RATES: ClassVar = (0.001, 0.0001)
    HAS_NO: ClassVar = ("interlevel_weight", "distortion_weight", "proposal_fraction")
    NETWORKS: ClassVar = 1

    training: Changes = key(
        Changes, "keys of `training` that are others for this model; no budget"
    )

    @pydantic.field_serializer("training")
    def as_given(self, changes):
        return changes.given

    @property
    def open(self):
        """Keys that `decide` leaves to a scene's facts: `decisions` has a rule each."""
        return []

    def closed(self, values):
        """The model with values, or the usual ones, for keys that are null."""
        return self

    @property
    def rates(self):
        """First and last learning rate that suit it."""
        return self.RATES

    @property
    def has_no(self):
        """Keys of a training that do nothing for it."""
        return self.HAS_NO

    @property
    def has_proposals(self):
        """Whether earlier rounds of samples only say where the last ones go."""
        return "interlevel_weight" not in self.HAS_NO and len(self.samples) > 1

    @property
    def points_a_ray(self):
        """Points of a ray that all its networks see in a training."""
        return sum(self.samples)

    @property
    def sized(self):
        """{key: what has the size of a network or of a grid}."""
        return {"width": self}

    def made(self, parts, *, native, moving):
        """(model, loss) of the system: a flax module as `rays.nerf` has it, and a loss.

        parts: the package `rays`. native: whether there are kernels. moving: rays are
        learnt too, so renders can be differentiated in them.
        """
        raise NotImplementedError

    def faults(self):
        # Nearer, float32 has too few distances between them.
        if hasattr(self, "far") and (1 + 1e-6) * self.closed({}).near >= self.far:
            yield "", "near must be smaller than far, by more than a millionth"
        for name in self.HAS_NO:
            if name in self.training.given:
                yield f"training.{name}", f"kind {self.kind} has none"
        for name, part in self.sized.items():
            if hasattr(part, "log2_hashmap_size"):
                values = part.levels * part.features * 2**part.log2_hashmap_size
            elif hasattr(part, "depth"):
                values = self.NETWORKS * part.depth * part.width**2
            else:
                continue
            # Besides the parameters, their gradients and the two moments of Adam.
            if 16 * values > MAX_BYTES:
                size = f"{16 * values / 2**30:.0f} GiB to train are more than"
                yield name, f"{size} {MAX_BYTES / 2**30:g} GiB"
