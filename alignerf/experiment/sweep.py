"""The tradeoff's variants: their jobs and their rows."""

from typing import NamedTuple

from alignerf.experiment import slices
from alignerf.experiment.trainings import RENDERED, from_photos


class Point(NamedTuple):
    """The base or a variant of it, and the files that its row comes from."""

    variant: str
    # Keys and values that differ from the base.
    changes: dict
    metrics: str
    training: str
    rendering: str


def variants(experiment):
    """(scene, {variant: what it changes}) from the base on.

    Raises ValueError for a config without a tradeoff.
    """
    found = experiment.config["tradeoff"]
    if not found:
        raise ValueError("config: tradeoff: not there, see workflow/config/demo.yaml")
    return found["scene"], {"base": {}} | found["variants"]


def names(experiment):
    """Names of the base and of all variants; none without a tradeoff."""
    if not experiment.config["tradeoff"]:
        return []
    return list(variants(experiment)[1])


def trainings(experiment, scene):
    """The base and its variants, in the sweep's scene: each is a training of its own.

    They learn from the scene's photos, or from those made smaller.
    """
    chosen = experiment.config["tradeoff"]
    if not chosen or chosen["scene"] != scene:
        return []
    return [training_of(experiment, scene, name) for name in names(experiment)]


def training_of(experiment, scene, name):
    """One point of the sweep."""
    folder = f"results/{scene}"
    factor = slices.variant_of(experiment.config, name)["downscale"]
    if factor != 1:
        folder = f"{folder}/tradeoff/downscale-{factor}"
    job = slices.of_variant(experiment, name)
    whole = from_photos(scene, f"tradeoff/{name}", job, alone=True)
    small = {"photos": f"{folder}/images", "cameras": f"{folder}/cameras.npz"}
    return whole._replace(prepared=folder, **small)


def configs(experiment):
    """The complete config of the sweep's scene, as a file beside its results."""
    scene, _ = variants(experiment)
    return [f"results/{scene}/config.yaml"]


def rows(experiment):
    """One row per variant, the base first."""
    scene, changes = variants(experiment)
    folders = {name: f"results/{scene}/tradeoff/{name}" for name in changes}
    return [
        Point(
            variant=name,
            changes=changes[name],
            metrics=f"{folder}/metrics.csv",
            training=f"{folder}/timing.json",
            rendering=f"{folder}/{RENDERED.format(split='test')}",
        )
        for name, folder in folders.items()
    ]
