"""The points of the sweep: the tradeoff's base and its variants."""

from alignerf.experiment import slices
from alignerf.experiment.trainings import from_photos


def variants(experiment):
    """(scene, {variant: what it changes}) from the base on.

    Raises ValueError for a config without a tradeoff.
    """
    found = experiment.config["tradeoff"]
    if not found:
        raise ValueError("config: tradeoff: not there, see workflow/config/demo.yaml")
    return found["scene"], {"base": {}} | found["variants"]


def scene_of(experiment):
    """[scene] of the sweep; [] without a tradeoff."""
    found = experiment.config["tradeoff"]
    return [found["scene"]] if found else []


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
