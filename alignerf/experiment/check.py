"""The config's check, before anything is planned: a fault is one line with its key."""

import os
import sys
from pathlib import Path

from alignerf import methods
from alignerf.experiment import schema
from alignerf.experiment.checks import (
    filled,
    names,
    results,
    scenes,
)
from alignerf.experiment.checks.common import fault, is_there
from alignerf.experiment.keys import config as config_keys
from alignerf.io import faults, yaml_files

# The Snakefile asks nothing but this package.
or_exit = faults.or_exit
check_free = names.check_free
# How a fault begins, as of `checks.common.fault`, where no file is known.
NO_FILE = "config: "
# Warnings of this process.
TOLD = set()


def checked(config, files=(), tell=True):
    """The complete `Config`: checked, and every key that it leaves out filled.

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
    config = filled.completed(sized(config))
    for name in config.methods:
        methods.check(config, name)
    check_reference(config)
    scenes.check_paths(config)
    every = config.methods.items()
    in_loop = [name for name, one in every if methods.of_method(one).in_loop]
    scenes.check_crops(config, in_loop)
    names.check_published(config)
    check_rounds_of_flow(config)
    config = leave_out_weights(config, tell)
    results.check_apart(config)
    return config


def sized(config):
    """The `Config` in the size that it asks for; ValueError for keys of the other."""
    if not isinstance(config, dict):
        fault("top level", "a config is a mapping of keys")
    found, sizes = valid(config), ("small", "full_size")
    if found.full_size is None:
        if not found.small:
            fault("small", "false needs full_size")
        return found
    if given := found.full_size.keys() & {*sizes}:
        fault(f"full_size.{min(given)}", "is of the config itself")
    own = {key: value for key, value in config.items() if key not in sizes}
    try:
        full = valid(own | found.full_size)
    except ValueError as error:
        # Without it the config is right.
        text = str(error).replace("config: top level", "config: full_size", 1)
        if text == str(error):
            text = text.replace("config: ", "config: full_size.", 1)
        raise ValueError(text) from None
    return found if found.small else full


def valid(config):
    """The `Config` of a mapping, of which each section is right."""
    names.check_names(config)
    return schema.check(config_keys.Config, config)


def check_reference(config):
    """The reference's round is one that is trained."""
    name, round = config.reference.method, config.reference.round
    if name not in config.methods:
        fault("reference.method", f"no method {name!r}")
    if round != "last" and round > config.methods[name].rounds:
        fault("reference.round", f"{name} has fewer rounds")


def check_rounds_of_flow(config):
    """Flows made elsewhere are of one round each."""
    template = config.flow.folder
    if template is None or "{round}" in template:
        return
    for name, method in config.methods.items():
        if method.rounds > 1:
            fault(
                "flow.folder",
                f"{template}: without {{round}} every round of methods.{name} would "
                "follow the flow of the first one's renders",
            )


def leave_out_weights(config, tell):
    """Without files of weights that are not there; each is told once."""

    def there(key, path, instead):
        if path is None or is_there(path, of_kind=Path.is_file):
            return path
        line = f"{key}: {path} does not exist: {instead}"
        if tell and line not in TOLD:
            TOLD.add(line)
            print(f"warning: {line}", file=sys.stderr)
        return None

    found = {
        net: there(f"lpips.{net}", path, f"no column lpips_{net}")
        for net, path in config.lpips
    }
    key, path = "frequency_weights", config.frequency_weights
    path = there(
        key, path, "the high-frequency loss takes derivative filters, not VGG-19"
    )
    lpips = config.lpips.model_copy(update=found)
    return config.model_copy(update={"lpips": lpips, key: path})
