"""What other packages add to the program: Python's entry points, by group.

A package names its objects under `alignerf.kinds`, `alignerf.test_sets`,
`alignerf.systems` or `alignerf.estimators`; docs/extending.md shows one of each.
"""

import functools
import importlib.metadata
import importlib.util
import sys
from pathlib import Path

GROUPS = tuple(f"alignerf.{n}" for n in ("kinds", "test_sets", "systems", "estimators"))


@functools.cache
def of_group(group):
    """{name: object} of what other packages have under `alignerf.<group>`.

    Ends the process with one line where one cannot be imported, or has the name of
    another.
    """
    points = sorted(importlib.metadata.entry_points(group=f"alignerf.{group}"))
    objects = {}
    for point in points:
        where = f"error: entry point {point.name} = {point.value} of alignerf.{group}"
        if point.name in objects:
            sys.exit(f"{where}: another package has the same name")
        try:
            objects[point.name] = point.load()
        # Whatever the code of others raises.
        except Exception as error:
            what = " ".join(f"{type(error).__name__}: {error}".split())
            sys.exit(f"{where}: {what}")
    return objects


def check_new(group, names, taken):
    """End the process with one line where a name of others is one of the program's."""
    for name in names:
        if name in taken:
            sys.exit(f"error: alignerf.{group}: {name} is a name that is taken")


@functools.cache
def names(group):
    """The names alone: nothing is imported for them."""
    points = importlib.metadata.entry_points(group=f"alignerf.{group}")
    return tuple(sorted(point.name for point in points))


@functools.cache
def files():
    """The modules that they lie in: a change of one is a change of the program."""
    points = (p for g in GROUPS for p in importlib.metadata.entry_points(group=g))
    specs = (importlib.util.find_spec(point.module) for point in points)
    return sorted({Path(spec.origin) for spec in specs if spec and spec.origin})
