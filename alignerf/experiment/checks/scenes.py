"""Scenes: what a source allows, and that its folders are there."""

from alignerf.captures import base
from alignerf.experiment import schema
from alignerf.experiment.checks import fetched
from alignerf.experiment.checks.common import check_path_variable, fault, is_there
from alignerf.experiment.keys import scene as scene_keys

# Keys of a scene that some sources have alone.
OWN = ("images", "background", "masks")


def checked(values):
    """A scene's slice of the config with its defaults; ValueError names a fault."""
    config = schema.filled(scene_keys.Scene, values)
    config["poses"] = base.of(config).poses_of(config)
    config["seed"] = config["seed"] or 0
    if config["adjust_again"] is None:
        # Of the courtyard the error is to be COLMAP's own.
        config["adjust_again"] = not base.of(config).has_truth
    check_scene(config)
    return config


def check_scene(scene, *place):
    """What the keys of a scene ask of each other; `place` are the keys above them."""
    where = "".join(f"{key}." for key in place)
    source = base.of(scene)
    if scene["poses"] not in source.poses:
        fault(
            f"{where}poses",
            f"{scene['poses']!r} is not possible for source {source.name!r}, only "
            + " or ".join(source.poses),
        )
    if source.has_path and not scene["path"]:
        fault(f"{where}path", f"source {source.name!r} needs one")
    for key in OWN:
        if scene[key] and key not in source.keys:
            fault(f"{where}{key}", f"source {source.name!r} has none")
    for key in scene_keys.SECTIONS.keys() - {source.name}:
        # Whole sections of defaults stand in every complete config.
        if scene_keys.Scene.default(key) is None and scene[key] is not None:
            fault(f"{where}{key}", f"goes with source {key!r}, and that with it")
    if scene["poses"] == "adjusted" and scene["triangulate"] is False:
        fault(f"{where}triangulate", "adjusted poses need matches")
    if scene["poses"] not in base.INPUT and scene["pose_convention"]:
        fault(f"{where}pose_convention", "only of cameras that came with the photos")
    for key, reason in source.faults(scene):
        fault(f"{where}{key}", reason)


def check_crops(config, in_loop):
    """Scenes and methods that crops are of are in the config.

    in_loop: names of the methods that align in their loop.
    """
    for name, scene in config["scenes"].items():
        capture, where = base.of(scene), f"scenes.{name}.crop"
        if not (of := capture.parent(scene)):
            continue
        parent = config["scenes"].get(of)
        if parent is None or base.of(parent).parent(parent):
            fault(f"{where}.of", f"{of} is none of the scenes that are whole")
        if (parent["source"], parent["path"]) != (scene["source"], scene["path"]):
            fault(f"{where}.of", f"{of} has another source or path than {name}")
        method = capture.cameras_by(scene)
        if method and method not in in_loop:
            fault(f"{where}.cameras", f"{method} is no method that aligns in its loop")


def check_path(scene, name):
    """The folders of a scene are there, their names without meaning for Snakemake."""
    for key, path in base.reads(scene).items():
        where = f"scenes.{name}.{key}"
        if path and set(path) & set("{}"):
            fault(where, f"{path}: braces mean wildcards, rename it")
        check_path_variable(where, path or "")
        if path and not (is_there(path) or fetched.by_rule(path)):
            fault(where, f"{path} does not exist")
