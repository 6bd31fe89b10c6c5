"""A config as a whole, and its variations."""

from typing import Annotated, Any, Literal

import pydantic

from alignerf import methods
from alignerf.experiment.keys.flow import Flow
from alignerf.experiment.keys.key import PATH, Keys, key, named
from alignerf.experiment.keys.model import Models
from alignerf.experiment.keys.scene import NAME, Scene
from alignerf.experiment.keys.training import Training
from alignerf.methods import base

Method = methods.keys_class(base.Common, base.PUBLISHED)


class Reference(Keys):
    method: str | None = key(
        None, "a key of methods; null: the first that trains from scratch"
    )
    round: int | Literal["last"] = key(
        "last", "its warping round; `last` is the method's last one", least=0, most=16
    )


class Lpips(Keys):
    alex: PATH | None = key(None, "AlexNet")
    vgg: PATH | None = key(None, "VGG-16")


class Vary(Keys):
    """Every scene again: `name_seed2`, `name_x0.5`, `name_seed2_x0.5`."""

    seeds: list[int] | None = key(
        None,
        "each scene is run with each seed; the first keeps the scene's name",
        least=0,
        most=2**32 - 1,
        length=(1, 100),
    )
    lengths: list[float] = key(
        [1],
        "multiples of its steps, or minutes, that each scene is trained for",
        above=0,
        most=1000,
        length=(1, 100),
    )


class Crops(Keys):
    """Crops at the photos' own size, by which the verdict judges alignment.

    Of every scene two more are made: SCENE_crops with its cameras as given and, where
    a method aligns itself in its loop, SCENE_crops_METHOD with that method's cameras.
    """

    px: int = key(
        160, "side of a crop in px of the photo, at most", least=48, most=4096
    )
    count: int = key(2, "crops of each photo", least=1, most=16)
    steps: int = key(
        2000,
        "steps of trainings on crops; more where `decide` gives a capture more",
        least=10,
        most=10**8,
    )


class Config(Keys):
    """Every key of a config. Only `scenes` has to be there."""

    # Of `--config small=false` Snakemake makes a word.
    small: Annotated[bool, pydantic.Strict(False)] = key(
        True,
        "as written; false: the keys of `full_size` replace those of the same name",
    )
    full_size: dict[str, Any] | None = key(
        None, "keys that replace the config's own where `small` is false"
    )
    seed: int = key(
        0, "random seed of scene, poses and trainings", least=0, most=2**32 - 1
    )
    preflight: bool = key(
        True,
        "minutes and memory are estimated before any training; false starts at once",
    )
    gpus: Literal[1, "all"] = key(
        1,
        "accelerators of a training or rendering: `all` shares its rays between those "
        "that `--resources gpu=N` allows",
    )
    scenes: named(Scene, NAME) = key(what="name -> where images and cameras come from")
    decide: bool = key(
        False,
        "settings that the config leaves out follow from the photos: downscale, near, "
        "radius, max_resolution, steps; results/<scene>/decisions.json says why",
    )
    vary: Vary | None = key(None, "seeds and lengths that every scene is run with")
    crops: Crops | None = key(
        None,
        "full-resolution crops of each photo, by which the verdict judges alignment; "
        "null: it judges at the size of training alone",
    )
    models: named(Models) = key(
        {"base": {}},
        "name -> a mip-NeRF 360 with two fields, or by `kind` another system",
        validate_default=True,
    )
    methods: named(Method) = key(
        {"mipnerf360": {"rounds": 2}, "alignerf": {"alignerf": {}}},
        "name -> what is trained and compared; in this order in the tables",
        validate_default=True,
    )
    training: Training = key(Training, "how models are trained, and how long")
    flow: Flow = key(Flow, "optical flow from renders to photos, and warping by it")
    reference: Reference = key(
        Reference, "the model whose renders the warped test set is made from"
    )
    frequency_weights: PATH | None = key(
        None,
        ".npz of VGG-19's first block for the high-frequency loss; null takes a fixed "
        "bank of oriented derivative filters",
    )
    aligned_pose: bool = key(
        True, "test set of cameras moved to fit their photos, half by half"
    )
    lpips: Lpips | None = key(
        Lpips,
        "network of LPIPS v0.1 -> .npz of its weights; null leaves a column empty",
    )
    export_width_px: int | None = key(
        None,
        "width of exported photos in px, made smaller by area averaging; null, or a "
        "width that would enlarge them, keeps their size",
        least=32,
        most=32766,
    )
    published_table: int | None = key(
        None,
        "the paper's table whose rows `snakemake comparison` shows, and whose effects "
        "it compares with ours",
        least=1,
        most=4,
    )
