"""What a config may name before it is there, since a rule fetches it."""

import os

from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys.key import home

# mip-NeRF 360's archives and the scenes in them.
ARCHIVES = {
    "360_v2.zip": (
        *("bicycle", "bonsai", "counter", "garden", "kitchen", "room", "stump"),
    ),
    "360_extra_scenes.zip": ("flowers", "treehill"),
}


def folder():
    """Where mip-NeRF 360's scenes lie."""
    path = home("${ALIGNERF_DATA:-.}/360_v2")
    if set(path) & set("{}"):
        fault("ALIGNERF_DATA", f"{path}: braces mean wildcards, rename it")
    return path


def scenes():
    """Paths of mip-NeRF 360's scenes that are not there; a broken link is."""
    names = sorted(name for inside in ARCHIVES.values() for name in inside)
    return [p for name in names if not os.path.lexists(p := f"{folder()}/{name}")]


def by_rule(path):
    """Whether a path is not there, and a rule fetches it."""
    return path in scenes()
