"""An external method: its commands, or a folder of finished renders."""

import shlex
from pathlib import Path

from alignerf.experiment import kinds, schema
from alignerf.experiment.checks import places
from alignerf.experiment.checks.common import check_path_variable, fault, is_there
from alignerf.experiment.keys import method as method_keys
from alignerf.experiment.keys import scene as scene_keys

# Keys of a method that an external one may have.
OF_EXTERNAL = ("external", "rounds", "most_rounds", "changes", "published", "model")
# What stands in braces in a command, and in the folder of finished renders.
OF_TRAIN = ("data", "model", "cores", "seed", "steps", "scene", "round")
OF_RENDER = (*OF_TRAIN, "renders", "depth")
OF_FOLDER = ("scene",)


def check(config, name):
    """Raises ValueError for what an external method cannot have, or lacks."""
    method, where = config["methods"][name], f"methods.{name}"
    default = schema.as_config(method_keys.Method())
    for key, value in method.items():
        if key not in OF_EXTERNAL and value != default[key]:
            fault(f"{where}.{key}", "not beside external")
    if method["model"] is not None:
        fault(f"{where}.model", "not beside external: models are those of ours")
    check_commands(config, method["external"], f"{where}.external")
    changes, rounds = method["changes"], method["rounds"]
    if method["external"]["renders"] and rounds != 0:
        fault(
            f"{where}.rounds", "0 was expected: finished renders are not trained anew"
        )
    if changes == "cameras" and rounds == 0:
        fault(f"{where}.changes", "cameras need a round to be put right for")
    if changes == "cameras_then_photos" and (rounds == "auto" or rounds < 2):
        reason = "cameras_then_photos needs a number of rounds, 2 or more"
        fault(f"{where}.changes", reason)


def check_commands(config, chosen, where):
    """Both commands, or a folder instead; what stands in braces has a meaning."""
    if chosen["renders"]:
        for key in ("train", "render"):
            if chosen[key]:
                fault(f"{where}.{key}", "not beside renders: nothing is trained")
        for key in ("renders", "depth"):
            check_folder(config, chosen[key], f"{where}.{key}")
        return
    for key in ("train", "render"):
        if not chosen[key]:
            fault(where, f"{key} is missing; both commands, or renders")
    if chosen["depth"]:
        fault(f"{where}.depth", "only beside renders: a command writes below {depth}")
    check_command(config, chosen["train"], OF_TRAIN, f"{where}.train")
    check_command(config, chosen["render"], OF_RENDER, f"{where}.render")
    if "renders" not in places.names(chosen["render"]):
        fault(f"{where}.render", "{renders} is missing, the folder of its images")


def check_command(config, command, known, where):
    """It can be split into words, and its places are known."""
    try:
        words = shlex.split(command)
    except ValueError as error:
        fault(where, f"{error}; quotes are as in a shell")
    if not (words and words[0].strip()):
        fault(where, "no program in it")
    check_places(command, known, where)
    unknown = any(scene["steps"] is None for scene in config["scenes"].values())
    unknown = unknown or "steps" in config["training"]["decided"]
    if unknown and "steps" in places.names(command):
        fault(where, "{steps} needs training.steps")


def check_folder(config, path, where):
    """A folder is there for each scene."""
    if path is None:
        return
    check_places(path, OF_FOLDER, where)
    check_path_variable(where, path)
    for scene, chosen in config["scenes"].items():
        folder = path.replace("{scene}", scene)
        there = is_there(folder, of_kind=Path.is_dir)
        if not (there or scene_keys.whole_of(chosen)):
            fault(where, f"{folder} does not exist")


def check_places(text, known, where):
    """ValueError for a name in braces without a meaning, and for a lonely brace."""
    try:
        places.check(text, known)
    except ValueError as error:
        fault(where, error)


def check_windows(config):
    """Windows at the photos' own size are trained by a method of ours."""
    reference = config["methods"][config["reference"]["method"]]
    windows = any(scene_keys.whole_of(one) for one in config["scenes"].values())
    if windows and kinds.of_method(reference) is kinds.external:
        fault(
            "windows", "not with an external reference: its program trains no windows"
        )
