"""Every key of a config: its default, its bounds and its meaning.

`schema` turns these classes into the JSON schema that a config is checked with, and
into `workflow/schemas/config.schema.yaml` for editors. A config says only what differs
from the defaults. Where a module has the same default for its own callers, a test holds
both equal. Numbers are finite; `least` and `most` bound them, `above` leaves the
bound itself out. Units are in the names.
"""

import dataclasses
import typing
from typing import Literal

# Of a key that every config has to give.
REQUIRED = dataclasses.MISSING


def key(default=REQUIRED, what="", **bounds):
    """A field of the classes below: its default, its meaning, its bounds."""
    metadata = {"what": what, **bounds}
    if default is REQUIRED:
        return dataclasses.field(metadata=metadata)
    if isinstance(default, list | dict) or dataclasses.is_dataclass(default):
        return dataclasses.field(default_factory=lambda: default, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def learning_rates(first, last):
    what = "first and last, log-linear between"
    return key([first, last], what, above=0, most=10, length=(2, 2))


def budget(what):
    return key(None, what, above=0, most=14400)


class Source(typing.NamedTuple):
    """Where images and cameras come from; `alignerf.scenes` reads them."""

    poses: tuple  # the ways in which it can have poses, the default first
    has_truth: bool = False
    has_path: bool = True


SOURCES = {
    "courtyard": Source(("colmap", "truth"), has_truth=True, has_path=False),
    "photos": Source(("colmap",)),
    "transforms": Source(("given",)),
    "llff": Source(("given",)),
    "mipnerf360": Source(("given",)),
    "blender": Source(("given",)),
}


def poses_of(scene):
    """The way in which a scene, as a mapping, has poses: its own or its source's."""
    return scene["poses"] or SOURCES[scene["source"]].poses[0]


def wants_points(scene):
    """Whether points of a scene's cameras are to be found, where they have none yet.

    Of given cameras unless it says no, of the courtyard's true ones where it says so.
    """
    poses, wanted = poses_of(scene), scene["triangulate"]
    return poses == "given" if wanted is None else wanted and poses != "colmap"


CAMERA_MODELS = Literal[
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"
]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Colmap:
    max_size_px: int = key(
        1600, "features are found on photos of at most this side", least=64, most=20000
    )
    camera_model: CAMERA_MODELS | None = key(
        None, "null takes OPENCV for photos, SIMPLE_PINHOLE for courtyard"
    )
    least_registered: float = key(
        0.6,
        "share of the photos that have to be registered in one model; with fewer the "
        "run stops: what is left would be scored as if it were the scene",
        least=0,
        most=1,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Courtyard:
    place: Literal["courtyard", "object"] = key(
        "courtyard", "the whole, or its boxes and the arm alone, before white"
    )
    views: int = key(48, "number of photos", least=4, most=10000)
    zooms: list[float] = key(
        [1.0],
        "focal lengths, in turn, in units of one that sees 60 degrees: by 0.25 things "
        "are as small as from four times the distance; other than 1 with true poses "
        "only",
        least=0.1,
        most=10,
        length=(1, 16),
    )
    width: int = key(400, "of a photo in px", least=32, most=16384)
    height: int = key(300, "of a photo in px", least=32, most=16384)
    motion: Literal["none", "uniform", "two_states"] = key(
        "uniform",
        "how objects move between photos: not, by a uniform displacement, or between "
        "two states of probability 0.5 (the paper's moving arm)",
    )
    motion_m: float = key(0.02, "largest displacement in metres", least=0, most=10)
    moving: list[str] | None = key(
        None, "names of the objects that move; null means all that can"
    )
    # Leaves as much near the highest frequency as a real photo made smaller has:
    # unblurred textures lose ten times more than photos when they are resampled.
    lens_sigma_px: float = key(
        1.4, "blur of the lens, in px of the photo", least=0, most=100
    )
    supersample: int = key(2, "rays a pixel and axis", least=1, most=16)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Scene:
    source: Literal[tuple(SOURCES)] = key(
        what="embedded scene, folder of photos, transforms.json, LLFF's "
        "poses_bounds.npy, a scene of mip-NeRF 360 (360_v2), or one of NeRF's "
        "synthetic scenes"
    )
    path: str | None = key(
        None,
        "folder of photos, of transforms.json, of poses_bounds.npy and images or "
        "images_<n>, of sparse/0 and images_<n>, or of transforms_train.json and "
        "transforms_test.json; none for courtyard",
    )
    images: int | None = key(
        None,
        "of mipnerf360: the n of the folder images_<n>, 1 for images; null takes the "
        "largest photos there are",
        least=1,
        most=64,
    )
    background: Literal["white", "black"] | None = key(
        None, "what transparent pixels stand on; null refuses them"
    )
    masks: str | None = key(
        None,
        "of photos: folder of <photo's file name>.png, black where a photo does not "
        "count, as COLMAP has them",
    )
    poses: Literal["colmap", "truth", "given"] | None = key(
        None,
        "courtyard has colmap (default) or truth, photos colmap, all others given",
    )
    downscale: int | Literal["auto"] = key(
        1,
        "photos are made smaller by this factor, by area averaging; auto takes the "
        "least with which all photos together have at most 10 million pixels",
        least=1,
        most=64,
    )
    test_every: int = key(
        8,
        "every n-th view by name is held out; blender's files, and a transforms.json "
        "with train_filenames and test_filenames, say which themselves",
        least=2,
        most=10000,
    )
    least_train_views: int = key(
        3,
        "with fewer to learn from the run stops: no geometry follows from them",
        least=1,
        most=10000,
    )
    seed: int | None = key(
        None,
        "of this scene, its poses and its trainings; null takes the config's",
        least=0,
        most=2**32 - 1,
    )
    steps: int | None = key(
        None,
        "of this scene's trainings; null takes the one under training",
        least=1,
        most=10**8,
    )
    budget_min: float | None = budget(
        "of this scene's trainings instead of steps; null takes the one under training"
    )
    perturb_px: float = key(
        0.0,
        "error added to the poses, in pixels (rms at the image's centre, after "
        "downscale), so that a small image shows the misalignment of a large one",
        least=0,
        most=1000,
    )
    triangulate: bool | None = key(
        None,
        "the points that views share are found, for what facts decide, and to say how "
        "right the poses are; null: yes with given poses, no otherwise (COLMAP has its "
        "own points); true: also with the courtyard's true poses",
    )
    colmap: Colmap = key(Colmap())
    courtyard: Courtyard = key(Courtyard())


PRECISIONS = Literal["float32", "bfloat16"]
PRECISION = (
    "of the layers and what passes between them; positions, encodings, densities, "
    "colours, parameters and all sums along a ray are float32"
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Grid:
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


@dataclasses.dataclass(frozen=True, kw_only=True)
class Mlp:
    """The published field; its defaults are those of `alignerf.fields.mlp`."""

    kind: Literal["mlp"] = key("mlp", "as published")
    width: int = key(1024, "channels (the paper's c)", least=1, most=16384)
    depth: int = key(8, "layers", least=1, most=64)
    skip_every: int = key(4, "layers between skips", least=1, most=64)
    degrees: int = key(12, "of the encoding", least=1, most=16)
    bottleneck: int = key(256, "numbers to the head", least=1, most=16384)
    view_width: int = key(128, "of the head's layer", least=1, most=16384)
    precision: PRECISIONS = key("float32", PRECISION)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Nerf:
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


FIELD = (
    "with `kind` the defaults of that kind; without it, changes of the default field"
)


@dataclasses.dataclass(frozen=True)
class Changes:
    """Keys of `training` in which a model's trainings differ; none is filled.

    A job's training has taken them in, so that of a job nothing is left here.
    """


def left_to_facts(*names):
    what = "keys that the scene's facts decide: all that a config with `decide` lacks"
    return key([], what, length=(0, len(names)))


def changes():
    what = "keys of `training` that are others for this model; not steps or budget"
    return key(Changes(), what)


# What `decide` leaves to a scene's facts: `alignerf.decisions` has a rule for each.
OPEN_OF_MODEL = ("near", "radius", "finest")
OPEN_OF_TRAINING = ("steps",)


BEHIND = "colour of what lies behind a ray's last sample: black, or white"
BEHIND_OR_OPAQUE = (
    f"{BEHIND}; null: the scene's own `background`, else unknown: a ray ends opaque. A "
    "mip-NeRF 360 with one learns from squared errors, without distortion_weight"
)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Model:
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
    proposal: Grid | Mlp = key(
        Grid(levels=4, log2_entries=15, features=2, finest=256, width=16), FIELD
    )
    field: Grid | Mlp | Nerf = key(Grid(finest=2048), FIELD)
    training: Changes = changes()
    decided: list[Literal[OPEN_OF_MODEL]] = left_to_facts(*OPEN_OF_MODEL)


NEAR = "nearest distance, in units of the largest camera coordinate"
TWO_LOOKS = "samples a ray in the first look, and more in the second"
SPACING = (
    "of the first look's samples: inverse, in 1 / distance, for scenes without a bound"
)


def samples(*default):
    # The first and last of a look's points have no part in the second's.
    return key([*default], TWO_LOOKS, least=3, most=4096, length=(2, 2))


@dataclasses.dataclass(frozen=True, kw_only=True)
class NerfSystem:
    """NeRF as published: two networks of points, without contraction."""

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


@dataclasses.dataclass(frozen=True, kw_only=True)
class MipNerfSystem:
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


@dataclasses.dataclass(frozen=True, kw_only=True)
class NerfPlusPlus:
    """NeRF++ as published: a sphere inside out, two networks for either part."""

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


@dataclasses.dataclass(frozen=True, kw_only=True)
class InstantNgp:
    """Instant-NGP's field as published; proposals find the samples."""

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


Models = Model | NerfSystem | MipNerfSystem | NerfPlusPlus | InstantNgp


# Networks of its size that a kind of model has, where it is more than one.
NETWORKS = {"nerf": 2, "nerfpp": 4}


def points_a_ray(model):
    """Points of a ray that all networks of a model see in a training."""
    coarse_and_fine = model.samples[0] + sum(model.samples)
    if model.kind == "nerf":
        return coarse_and_fine
    if model.kind == "nerfpp":
        return 2 * coarse_and_fine
    return sum(model.samples)


def field_kind(model):
    """What decides a model's learning rates and memory, of a mapping with defaults."""
    return model["field"]["kind"] if "field" in model else model["kind"]


def squares_errors(model):
    """Whether a mip-NeRF 360 learns from squared errors alone, of a mapping.

    As BARF does, and where the background is known: by Charbonnier's loss, whose best
    constant is the median, an object before white was taken for all white.
    """
    return model["field"]["kind"] == "nerf" or model["background"] is not None


@dataclasses.dataclass(frozen=True, kw_only=True)
class WarmStart:
    from_: str = key(what="method of the same model whose round 0 it starts from")
    share: float = key(
        0.3, "of training.steps, in each round of warping", above=0, most=1
    )
    learning_rates: list[float] = learning_rates(0.01, 0.001)


@dataclasses.dataclass(frozen=True, kw_only=True)
class AligNeRF:
    """The three contributions and the two stages' shares of the steps."""

    pretrain_share: float = key(
        0.6, "of training.steps, as the baseline", above=0, most=1
    )
    finetune_share: float = key(0.2, "of training.steps, on patches", above=0, most=1)
    learning_rates: list[float] = learning_rates(0.003, 0.0003)
    patches: int = key(4, "patches a step", least=1, most=4096)
    patch_px: int = key(16, "side of a patch", least=8, most=512)
    convolution: bool = key(
        True, "contribution 1, patch convolution; false shows the model's colours"
    )
    features: int = key(16, "N of the patch convolution", least=3, most=1024)
    matching: Literal["patch", "pixel"] = key(
        "patch",
        "contribution 2, what moves over the photo: a whole patch (Eq. 4), or every "
        "pixel on its own (contextual loss, which the paper compares with)",
    )
    error: Literal["squared", "charbonnier"] = key(
        "squared",
        "of the render and what it was matched with: squared (as printed), or "
        "charbonnier (the baseline's)",
    )
    radius_px: int | Literal["auto"] = key(
        8,
        "largest offset searched; 0 searches none; auto takes it from the displacement "
        "of the training views after the baseline's first round",
        least=0,
        most=64,
    )
    align_penalty: float = key(
        0.01,
        "weight of the offset's length in px: lambda of Eq. 4 against the error summed "
        "over a patch; of a pixel against its mean squared error",
        least=0,
        most=1e6,
    )
    frequency_weight: float = key(
        0.05,
        "contribution 3, w of the high-frequency loss; 0 has none",
        least=0,
        most=1e6,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Refine:
    """Cameras learnt with the scene, as BARF and CamP do."""

    learning_rates: list[float] = learning_rates(0.001, 0.00001)
    delay_share: float = key(
        0.1, "of the steps before the cameras may move", least=0, most=0.99
    )
    preconditioned: bool = key(
        True, "turns and steps in units that move pixels alike, as CamP"
    )
    coarse_to_fine: list[float] | None = key(
        None,
        "shares of the steps between which the field's frequencies, or the levels of "
        "a grid, come in one by one; BARF's are 0.1 and 0.5; null: all from the start",
        least=0,
        most=1,
        length=(2, 2),
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Align:
    """Alignment on the way: where one training stops, and what it puts right there."""

    cameras_at: list[float] = key(
        [0.15, 0.35],
        "shares of the steps at which the cameras of the training views are put right",
        above=0,
        most=0.99,
        length=(0, 16),
    )
    photos_at: list[float] = key(
        [0.35],
        "shares of the steps at which photos are warped, after the cameras if both",
        above=0,
        most=0.99,
        length=(0, 16),
    )
    photos: Literal["moving", "whole"] = key(
        "moving",
        "what a photo is warped by: what no moved camera explains of its flow, or all",
    )
    shrink: int = key(
        3,
        "renders and photos are made smaller by at most this factor for the flow; less "
        "where the estimator would have too few pixels a side",
        least=1,
        most=16,
    )
    least_move_px: float = key(
        0.12,
        "where the median camera would move by less, in px of the small renders, that "
        "is the flow's own error and all stay; more early in the training, less once "
        "cameras were seen to be wrong",
        least=0,
        most=100,
    )
    estimator: Literal[
        "dis_ultrafast", "dis_fast", "dis_medium", "dis_fine", "dis_smooth", "deepflow"
    ] = key("deepflow", "of the flow, see `flow.estimator`")
    match_blur: bool = key(
        False, "blur the photo like the render, for the estimate only"
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Method:
    model: str | None = key(None, "a key of models; null takes the first")
    rounds: int | Literal["auto"] = key(
        0,
        "warping rounds after the first training; auto goes on until the flow from "
        "renders to the photos they were learnt from falls by less than a tenth, see "
        "flow/rounds.py; decision.json of each round before most_rounds says why",
        least=0,
        most=16,
    )
    most_rounds: int = key(
        4, "where `rounds: auto` ends, whatever the flow does", least=1, most=16
    )
    changes: Literal["photos", "cameras", "cameras_then_photos"] = key(
        "photos",
        "what a round changes by the flow: photos are warped, as in the paper, or the "
        "training views' cameras are put right; cameras_then_photos warps photos in "
        "the last round only; with alignerf, cameras are put right before fine-tuning",
    )
    warm_start: WarmStart | None = key(
        None,
        "each warping round goes on from the weights of the one before, instead of "
        "from scratch as in the paper",
    )
    alignerf: AligNeRF | None = key(
        None, "staged training with the three contributions"
    )
    refine: Refine | None = key(
        None, "the training views' cameras are learnt with the scene, without flow"
    )
    align: Align | None = key(
        None, "alignment on the way: the training puts right what it learns from"
    )
    renders: str | None = key(
        None,
        "instead of a training: folder of another program's renders of the test views, "
        "<view>.png of the scene's size (8-bit RGB); {scene} stands for the scene's "
        "name; they are scored, and no more",
        pattern=r"\S",
    )
    published: str | None = key(
        None,
        "what results/published calls the method; `snakemake comparison` shows what is "
        "printed for it",
        pattern=r"\S",
    )


# Chosen on courtyard, seed 1.
RATES = {
    "grid": (0.03, 0.003),
    "mlp": (0.01, 0.001),
    "nerf": (0.001, 0.0001),
    "mipnerf": (0.001, 0.0001),
    "nerfpp": (0.001, 0.0001),
    "ngp": (0.03, 0.003),
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Training:
    """How the baseline is trained; the other stages start from it."""

    steps: int | None = key(
        4000, "of the baseline; null with a budget_min", least=1, most=10**8
    )
    budget_min: float | None = budget(
        "minutes of the baseline's training, instead of steps: as many as the machine, "
        "timed at the start, does in them; each stage takes its share of the minutes"
    )
    batch_rays: int = key(512, "rays a step", least=1, most=2**22)
    learning_rates: list[float] | None = key(
        None,
        "first and last; null takes what suits the field's kind: "
        + ", ".join(
            f"{first} and {last} for {kind}" for kind, (first, last) in RATES.items()
        ),
        above=0,
        most=10,
        length=(2, 2),
    )
    warmup_steps: int | None = key(
        None, "sine from 1 %; null takes a tenth of the steps", least=0, most=10**8
    )
    hold_share: float = key(
        0.5,
        "of the steps before the learning rate falls; 0 as published",
        least=0,
        most=0.99,
    )
    adam_betas: list[float] = key(
        [0.9, 0.99], "0.9 and 0.999 as published", least=0, most=0.999999, length=(2, 2)
    )
    adam_eps: float = key(1e-15, above=0, most=1)
    gradient_norm: float | None = key(
        None,
        "largest norm of each network's gradient; null does not clip",
        above=0,
        most=1e9,
    )
    proposal_share: float = key(
        0.25,
        "of a step's rays teach the proposal field, for whom the others are samples "
        "only; 1 as published",
        above=0,
        most=1,
    )
    interlevel_weight: float = key(1.0, least=0, most=1e6)
    distortion_weight: float = key(0.01, least=0, most=1e6)
    decided: list[Literal[OPEN_OF_TRAINING]] = left_to_facts(*OPEN_OF_TRAINING)


def warmup(training):
    """The warm-up of a training, as a mapping, that may leave it to its steps.

    Null as long as its steps are not known.
    """
    given, steps = training["warmup_steps"], training["steps"]
    if given is None and steps is not None:
        given = round(0.1 * steps)
    return {"warmup_steps": given}


def rates(training, kind):
    """The learning rates of a training, as a mapping, that may leave them to the field.

    kind: as of `field_kind`.
    """
    return {"learning_rates": training["learning_rates"] or list(RATES[kind])}


def leave_open(config):
    """A config as it was written, with all that it leaves to the scenes' facts.

    Without `decide` that is nothing. A complete config says in `decided` what it left;
    what was changed in it since then is no longer left.
    """
    asked = config.get("decide") is True
    models = {
        name: model | {"decided": open_of_model(model) if asked else []}
        for name, model in (config.get("models") or {"base": {}}).items()
    }
    training, scenes = config.get("training") or {}, config["scenes"]
    if asked:
        scenes = {
            name: ({"downscale": "auto"} if SOURCES[scene["source"]].has_path else {})
            | scene
            for name, scene in scenes.items()
        }
    open_keys = open_of_training(training, scenes.values()) if asked else []
    training = training | {"decided": open_keys}
    return config | {"models": models, "scenes": scenes, "training": training}


def open_of_model(given):
    """The keys that a model as it was written leaves to facts."""
    if given.get("kind", Model.kind) != Model.kind:
        return []
    field = given.get("field") or {}
    kind = field.get("kind", Grid.kind)
    # Only a grid has cells; a field of points contracts nothing.
    fits = {"finest": kind == Grid.kind, "radius": kind != Nerf.kind}
    usual = {
        "near": (Model.near,),
        "radius": (Model.radius,),
        "finest": (Grid.finest, Model().field.finest),
    }
    found = []
    for name in OPEN_OF_MODEL:
        value = (field if name == "finest" else given).get(name)
        left = value is None
        if "decided" in given:
            left = name in given["decided"] and value in (None, *usual[name])
        if left and fits.get(name, True):
            found.append(name)
    return found


def open_of_training(given, scenes):
    """Its steps, where neither training nor a scene says how long it is."""
    usual = (None,)
    if "decided" in given:
        if "steps" not in given["decided"]:
            return []
        usual = (None, Training.steps)
    said = [(one.get("steps"), one.get("budget_min")) for one in (given, *scenes)]
    if any(steps not in usual or budget_min for steps, budget_min in said):
        return []
    return list(OPEN_OF_TRAINING)


def check_length(given, where):
    """ValueError where a mapping as it was written has steps and a budget."""
    if given.get("steps") is not None and given.get("budget_min") is not None:
        raise ValueError(f"config: {where}.budget_min: not beside steps, choose one")


def length(training):
    """What decides how long a training is, of a mapping with defaults: one is null."""
    steps, budget_min = training["steps"], training["budget_min"]
    if steps is None and budget_min is None:
        raise ValueError("config: training.steps: null is only for a budget_min")
    steps = steps if budget_min is None else None
    return {"steps": steps, "budget_min": budget_min}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Flow:
    estimator: Literal[
        "dis_ultrafast",
        "dis_fast",
        "dis_medium",
        "dis_fine",
        "dis_smooth",
        "deepflow",
        "farneback",
        "tvl1",
        "simpleflow",
        "files",
    ] = key(
        "deepflow",
        "see flow/estimation/estimators.py and `snakemake flow_benchmark`; files takes "
        "flows made elsewhere from `folder`",
    )
    folder: str | None = key(
        None,
        "where estimator `files` finds <view>.flo or <view>.npz (render to photo) and, "
        "if there is a check to be made, <view>.back.flo or .npz; {scene}, {method}, "
        "{round} and {split} in it stand for the renders' own; after pre-training, "
        "where cameras are put right then, {method} is pretrain and {round} the model",
    )
    match_blur: bool = key(
        True, "blur the photo like the render, for the estimate only"
    )
    kernel: Literal["lanczos", "cubic", "bilinear"] = key("lanczos", "of the warps")
    tolerance_px: float = key(
        1.0,
        "largest forward-backward disagreement of a valid pixel",
        above=0,
        most=1000,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Reference:
    method: str | None = key(
        None, "a key of methods; null takes the first that trains from scratch"
    )
    round: int | Literal["last"] = key(
        "last", "its warping round; `last` is the method's last one", least=0, most=16
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class AlignedPose:
    """The test set whose cameras are moved to fit their photos, half by half."""

    flow: bool = key(True, "by the flow from render to photo")
    gradient_steps: int = key(
        0,
        "and by so many of gradient descent; the field takes 100",
        least=0,
        most=10**5,
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Lpips:
    alex: str | None = key(None, "AlexNet")
    squeeze: str | None = key(None, "SqueezeNet 1.1")
    vgg: str | None = key(None, "VGG-16")


# Keys of a training that say how long it is.
LENGTH = ("steps", "budget_min", "warmup_steps")
# What a point of the sweep may change, of the model and of the training.
VARIES = {
    Model: ("samples", "proposal", "field"),
    Training: (
        *(*LENGTH, "batch_rays", "learning_rates"),
        *("hold_share", "adam_betas", "adam_eps", "gradient_norm", "proposal_share"),
    ),
}


class Variant:
    """The keys in which a point of the sweep differs from the base; none is filled."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class Tradeoff:
    scene: str | None = key(None, "a key of scenes; null takes the first")
    model: str | None = key(
        None, "a key of models, the row `base`; null takes the first"
    )
    variants: dict[str, Variant] = key(
        what="name -> the keys in which it differs from the base"
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Vary:
    """Every scene again: `name_seed2`, `name_x0.5`, `name_seed2_x0.5`."""

    seeds: list[int] | None = key(
        None,
        "each scene is made and trained with each; the first keeps the scene's name",
        least=0,
        most=2**32 - 1,
        length=(1, 100),
    )
    lengths: list[float] = key(
        [1],
        "and trained for each of these times its steps, or minutes",
        above=0,
        most=1000,
        length=(1, 100),
    )


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config:
    """Every key of a config. Only `scenes` has to be there."""

    seed: int = key(0, "of scene, poses and trainings", least=0, most=2**32 - 1)
    preflight: bool = key(
        True,
        "hours, memory and disk are worked out before any training; false starts at "
        "once",
    )
    scenes: dict[str, Scene] = key(
        what="name -> where its images and cameras come from"
    )
    decide: bool = key(
        False,
        "a scene's facts decide what scenes, models and training leave out: downscale, "
        "near, radius, finest, steps; results/<scene>/decisions.json says why",
    )
    vary: Vary | None = key(None, "seeds and lengths that every scene is run with")
    models: dict[str, Models] = key(
        {"base": {}},
        "name -> a mip-NeRF 360 with two fields, or by `kind` another system",
    )
    methods: dict[str, Method] = key(
        {"mipnerf360": {"rounds": 2}, "alignerf": {"alignerf": {}}},
        "name -> what is trained and compared; in this order in the tables",
    )
    training: Training = key(Training())
    flow: Flow = key(Flow())
    reference: Reference = key(
        Reference(), "the model whose renders the warped test set is made from"
    )
    regimes: str = key(
        "alignerf_regimes",
        "what `snakemake regimes` calls its files in results/",
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,99}\Z",
    )
    frequency_weights: str | None = key(
        None,
        ".npz of VGG-19's first block for the high-frequency loss; null takes a fixed "
        "bank of oriented derivative filters, and the table says so",
    )
    aligned_pose: AlignedPose | None = key(
        AlignedPose(), "test set of cameras moved to fit their photos; null has none"
    )
    lpips: Lpips | None = key(
        Lpips(),
        "network of LPIPS v0.1 -> .npz of its weights; null leaves a column empty",
    )
    tradeoff: Tradeoff | None = key(
        None, "what `snakemake tradeoff` compares; needed by nothing else"
    )
    published_table: int | None = key(
        None,
        "the paper's table, 2 or 3, whose rows `snakemake comparison` shows",
        least=2,
        most=3,
    )
