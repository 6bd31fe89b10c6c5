"""How a fault is told, and what several checks ask."""

import re
from pathlib import Path

from alignerf.experiment import kinds

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


def is_derived(method):
    """Whether a method is no training from scratch that others may be set against."""
    return kinds.of_method(method) is not kinds.plain
