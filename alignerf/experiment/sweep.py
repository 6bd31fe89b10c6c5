"""The tradeoff's variants: their jobs and their rows."""

from typing import NamedTuple

from alignerf.experiment import slices


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


def photos_of_variant(experiment, scene, variant):
    """The scene's own photos and cameras, or those made smaller."""
    folder = f"results/{scene}"
    factor = slices.variant_of(experiment.config, variant)["downscale"]
    if factor != 1:
        folder = f"{folder}/tradeoff/downscale-{factor}"
    cameras = f"{folder}/cameras.npz"
    return {"photos": f"{folder}/images", "cameras": cameras, "used": cameras}


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
            rendering=f"{folder}/render_test.json",
        )
        for name, folder in folders.items()
    ]
