"""How a fault is told, and what several checks ask."""

import os
import re
from pathlib import Path

from alignerf.captures import base

DATA = re.compile(r"\$\{ALIGNERF_DATA:-([^{}]*)\}")
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


def home(path):
    """A path with `~` and ${ALIGNERF_DATA:-default} written out, as a shell does it.

    The variable names the folder of real data, the default stands in the config.
    """
    if path is None:
        return None
    given = os.environ.get("ALIGNERF_DATA")
    path = DATA.sub(lambda found: given or found[1], path)
    try:
        return str(Path(path).expanduser())
    except RuntimeError:
        raise ValueError(f"config: {path}: no such user's home") from None


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
