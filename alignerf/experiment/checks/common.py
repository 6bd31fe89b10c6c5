"""How a fault is told, and what several checks ask."""

import re
from pathlib import Path

from alignerf.captures import base

# What Snakemake puts a path in place of.
PATH_VARIABLE = re.compile(r"<[a-z][a-z0-9_]*>")


def fault(where, what):
    raise ValueError(f"config: {where}: {what}")


def is_there(path, *, of_kind=Path.exists):
    """Whether a path exists; one that no file can have does not."""
    try:
        return of_kind(Path(path))
    except OSError:
        return False


def check_path_variable(where, path):
    """ValueError where a path has a name in angle brackets."""
    if found := PATH_VARIABLE.search(path):
        fault(where, f"{path}: {found[0]} means another path to Snakemake, rename it")


def first(names):
    return next(iter(names))


def check_folder(config, template, where):
    """ValueError where a folder is not there for each scene; {scene} stands for one."""
    if template is None:
        return
    if set(template.replace("{scene}", "")) & set("{}"):
        fault(where, f"{template}: in braces only scene has a meaning")
    check_path_variable(where, template)
    for scene, chosen in config["scenes"].items():
        path = template.replace("{scene}", scene)
        # Crops of another scene have no renders of their own.
        crops = base.of(chosen).parent(chosen)
        if not (crops or is_there(path, of_kind=Path.is_dir)):
            fault(where, f"{path} does not exist")
