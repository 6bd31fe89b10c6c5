"""The config's check, before anything is planned: a fault is one line with its key."""

import os
import sys
from pathlib import Path

from alignerf import methods
from alignerf.captures import base
from alignerf.experiment import schema
from alignerf.experiment.checks import (
    filled,
    models,
    names,
    results,
    scenes,
)
from alignerf.experiment.checks.common import fault, is_there
from alignerf.experiment.keys import config as config_keys
from alignerf.experiment.keys import left as left_keys
from alignerf.experiment.keys import training as training_keys
from alignerf.io import faults, yaml_files

# The Snakefile asks nothing but this package.
or_exit = faults.or_exit
check_free = names.check_free
# How a fault begins, as of `checks.common.fault`, where no file is known.
NO_FILE = "config: "
# Warnings of this process.
TOLD = set()


def checked(config, files=(), tell=True):
    """The complete config: checked, and every key that it leaves out filled.

    config: what YAML made of `files`, merged. tell: whether to warn of weights that are
    not there. Raises ValueError, naming the key and the files.
    """
    for path in files:
        yaml_files.read(path)
    return named(files, complete, config, tell)


def named(files, function, *arguments):
    """function(*arguments); a ValueError on a config names the files that it is of."""
    try:
        return function(*arguments)
    except ValueError as error:
        text = str(error)
        if files and text.startswith(NO_FILE):
            every = (min(str(f), os.path.relpath(f), key=len) for f in files)
            text = text.replace(NO_FILE, f"{', '.join(every)}: ", 1)
        raise ValueError(text) from None


def complete(config, tell=True):
    """The same of a config whose files have been read."""
    if not isinstance(config, dict):
        fault("top level", "a config is a mapping of keys")
    names.check_names(config)
    schema.check(config_keys.Config, config)
    config = sized(config)
    check_given(config)
    config = left_keys.leave_open(config)
    config = filled.completed(schema.filled(config_keys.Config, config))
    del config["small"], config["full_size"]
    for name, model in config["models"].items():
        models.check_model(model, "models", name)
    for name in config["methods"]:
        methods.check(config, name)
    check_reference(config)
    for name, scene in config["scenes"].items():
        scenes.check_scene(scene, "scenes", name)
        scenes.check_path(scene, name)
    every = config["methods"].items()
    in_loop = [name for name, one in every if methods.of_method(one).in_loop]
    scenes.check_crops(config, in_loop)
    names.check_published(config)
    check_flow(config["flow"], config["methods"])
    leave_out_weights(config, tell)
    results.check_apart(config)
    return config


def sized(config):
    """The config in the size that it asks for; ValueError for keys of the other."""
    full_size = config.get("full_size")
    small = config_keys.Config.model_validate(config).small
    own = {key: v for key, v in config.items() if key not in ("small", "full_size")}
    if full_size is None:
        if not small:
            fault("small", "false needs full_size")
        return own
    if sizes := {"small", "full_size"} & full_size.keys():
        fault(f"full_size.{min(sizes)}", "is of the config itself")
    full = own | full_size
    try:
        names.check_names(full)
        schema.check(config_keys.Config, full)
    except ValueError as error:
        # Without it the config is right.
        text = str(error).replace("config: top level", "config: full_size", 1)
        if text == str(error):
            text = text.replace("config: ", "config: full_size.", 1)
        raise ValueError(text) from None
    return own if small else full


def check_given(config):
    """What only the config as it was written can tell: keys that act on nothing."""
    training_keys.check_length(config.get("training", {}), "training")
    for name, scene in config["scenes"].items():
        training_keys.check_length(scene, f"scenes.{name}")
        given = scene.get("test_every") is not None
        if given and base.of(scene).says_split:
            said = f"{scene['source']}'s files say what is held out"
            fault(f"scenes.{name}.test_every", said)
        if scene.get("seed") is not None and (config.get("vary") or {}).get("seeds"):
            fault(f"scenes.{name}.seed", "not beside vary.seeds")


def check_reference(config):
    """The reference's round is one that is trained."""
    name, round = config["reference"]["method"], config["reference"]["round"]
    if name not in config["methods"]:
        fault("reference.method", f"no method {name!r}")
    rounds = config["methods"][name]["rounds"]
    if round != "last" and round > rounds:
        fault("reference.round", f"{name} has fewer rounds")


def check_flow(flow, methods):
    """The folder of flows made elsewhere, with the names that stand for renders."""
    template = flow["folder"]
    if flow["estimator"] == "files" and not template:
        fault("flow", "'folder' is a required property of estimator 'files'")
    if template is None:
        return
    if flow["estimator"] != "files":
        fault("flow.folder", f"estimator {flow['estimator']!r} reads none")
    # Plain names: format specifications and attributes could ask for anything.
    rest = template
    for name in ("scene", "method", "round", "split"):
        rest = rest.replace(f"{{{name}}}", "")
    if set(rest) & set("{}"):
        fault(
            "flow.folder",
            f"{template}: in braces only scene, method, round and split have a meaning",
        )
    for name, method in methods.items():
        if method["rounds"] not in (0, 1) and "{round}" not in template:
            fault(
                "flow.folder",
                f"{template}: without {{round}} every round of methods.{name} would "
                "follow the flow of the first one's renders",
            )


def leave_out_weights(config, tell):
    """Without files of weights that are not there; each is told once."""

    def missing(key, path, instead):
        there = is_there(path or "", of_kind=Path.is_file)
        if path is None or there:
            return False
        line = f"{key}: {path} does not exist: {instead}"
        if tell and line not in TOLD:
            TOLD.add(line)
            print(f"warning: {line}", file=sys.stderr)
        return True

    for net, path in list(config["lpips"].items()):
        if missing(f"lpips.{net}", path, f"no column lpips_{net}"):
            del config["lpips"][net]
    path = config["frequency_weights"]
    instead = "the high-frequency loss takes derivative filters, not VGG-19"
    if missing("frequency_weights", path, instead):
        config["frequency_weights"] = None
