"""Scenes: what their crops are of, and that what is read is there."""

import re
from pathlib import Path

from alignerf.captures import base
from alignerf.experiment import schema
from alignerf.experiment.checks import fetched
from alignerf.experiment.checks.common import fault, is_there
from alignerf.experiment.keys import scene as scene_keys

# What Snakemake puts a path in place of.
PATH_VARIABLE = re.compile(r"<[a-z][a-z0-9_]*>")


def checked(values):
    """A scene's slice of the config with its defaults; ValueError names a fault."""
    scene = schema.check(scene_keys.Scene, values)
    source = base.of(scene)
    found = {"poses": source.poses_of(scene), "seed": scene.seed or 0}
    if scene.adjust_again is None:
        # Of the courtyard the error is to be COLMAP's own.
        found["adjust_again"] = not source.has_truth
    return scene.model_copy(update=found)


def check_crops(config, in_loop):
    """Scenes and methods that crops are of are in the config.

    in_loop: names of the methods that align in their loop.
    """
    for name, scene in config.scenes.items():
        capture, where = base.of(scene), f"scenes.{name}.crop"
        if not (of := capture.parent(scene)):
            continue
        parent = config.scenes.get(of)
        if parent is None or base.of(parent).parent(parent):
            fault(f"{where}.of", f"{of} is none of the scenes that are whole")
        if (parent.source, parent.path) != (scene.source, scene.path):
            fault(f"{where}.of", f"{of} has another source or path than {name}")
        method = capture.cameras_by(scene)
        if method and method not in in_loop:
            fault(f"{where}.cameras", f"{method} is no method that aligns in its loop")


def check_paths(config):
    """What is read is there, and its names have no meaning for Snakemake.

    {scene} in a method's stands for each scene; crops have no renders of their own.
    """
    every, own = [], []
    for name, scene in config.scenes.items():
        own += [] if base.of(scene).parent(scene) else [name]
        for key, path in scene.paths().items():
            every.append((f"scenes.{name}.{key}", path, Path.exists))
    for name, method in config.methods.items():
        for key, path in method.paths().items():
            paths = (path.replace("{scene}", scene) for scene in own)
            every += [(f"methods.{name}.{key}", one, Path.is_dir) for one in paths]
    for where, path, of_kind in every:
        if set(path) & set("{}"):
            fault(where, f"{path}: braces mean wildcards, rename it")
        if found := PATH_VARIABLE.search(path):
            what = f"{found[0]} means another path to Snakemake, rename it"
            fault(where, f"{path}: {what}")
        if not (is_there(path, of_kind=of_kind) or fetched.by_rule(path)):
            fault(where, f"{path} does not exist")
