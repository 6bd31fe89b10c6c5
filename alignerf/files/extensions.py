"""What other packages add to the program: Python's entry points, by group.

A package names its objects under `alignerf.kinds`, `alignerf.test_sets`,
`alignerf.systems` or `alignerf.estimators`; docs/extending.md shows one of each.
"""

import functools
import importlib.metadata
import importlib.util
from pathlib import Path

GROUPS = tuple(f"alignerf.{n}" for n in ("kinds", "test_sets", "systems", "estimators"))


@functools.cache
def of_group(group):
    """{name: object} of what other packages have under `alignerf.<group>`."""
    points = importlib.metadata.entry_points(group=f"alignerf.{group}")
    return {point.name: point.load() for point in sorted(points)}


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
