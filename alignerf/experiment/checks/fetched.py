"""What a config may name before it is there, since a rule fetches it."""

from pathlib import Path

from alignerf.experiment.checks.common import home, is_there

# mip-NeRF 360's archives and the scenes in them.
ARCHIVES = {
    "360_v2.zip": (
        *("bicycle", "bonsai", "counter", "garden", "kitchen", "room", "stump"),
    ),
    "360_extra_scenes.zip": ("flowers", "treehill"),
}
# Path of a network's weights -> what `alignerf.networks.weights` calls them.
WEIGHTS = {"weights/vgg19.npz": "frequency"} | {
    f"weights/lpips_{net}.npz": f"lpips_{net}" for net in ("alex", "squeeze", "vgg")
}


def folder():
    """Folder of mip-NeRF 360's scenes: 360_v2, below that of real data."""
    return home("${ALIGNERF_DATA:-.}/360_v2")


def scenes():
    """Paths of the scenes in it that are not there."""
    names = sorted(name for inside in ARCHIVES.values() for name in inside)
    paths = (str(Path(folder()) / name) for name in names)
    return [path for path in paths if not is_there(path)]


def weights():
    """{path: what} of the weights that are not there."""
    return {path: what for path, what in WEIGHTS.items() if not is_there(path)}


def by_rule(path):
    """Whether a path is not there, and a rule fetches it."""
    return path in scenes() or path in weights()
