"""What other packages add to the program: Python's entry points, by group.

A package names its objects under `alignerf.captures`, `alignerf.methods`,
`alignerf.causes`, `alignerf.test_sets`, `alignerf.systems` or `alignerf.estimators`;
CONTRIBUTING.md shows one of each.
"""

import functools
import importlib
import importlib.metadata
import importlib.util
import numbers
import pkgutil
import sys
from collections.abc import Callable
from pathlib import Path

# {group: what its objects must have}.
NEEDED = {
    "captures": ("name", "what", "poses", "detect", "read"),
    "methods": ("key", "annotation", "field", "trainings", "words", "moves"),
    "causes": ("name", "label", "unit", "find", "advice", "explains"),
    "test_sets": ("name", "pixels", "meaning", "needs", "make", "tables"),
    "systems": ("made", "kind", "near", "samples", "training"),
    "estimators": ("calculate", "min_side_px"),
}
# Of what kind some of these are: an object may say that it has whatever is asked for.
TEXTS = ("name", "what", "label", "unit", "pixels", "meaning", "needs", "kind")
TEXTS += ("advice",)
CALLED = ("detect", "read", "trainings", "words", "moves", "find")
CALLED += ("make", "made", "calculate")
KINDS = dict.fromkeys(TEXTS, str) | dict.fromkeys(CALLED, Callable)
KINDS |= dict.fromkeys(("poses", "tables", "explains"), tuple | list)
KINDS |= {"min_side_px": numbers.Real, "key": str | None}


@functools.cache
def of_group(group):
    """{name: object} of what other packages have under `alignerf.<group>`.

    Ends the process with one line where one cannot be imported, or has the name of
    another.
    """
    objects = {}
    for point in points(group):
        of = f"alignerf.{group} of {called(point.dist)}"
        where = f"error: entry point {point.name} = {point.value} of {of}"
        if point.name in objects:
            sys.exit(f"{where}: another package has the same name")
        objects[point.name], fault = tried(taken, point, NEEDED[group])
        if fault:
            sys.exit(f"{where}: {fault}")
    return objects


@functools.cache
def points(group):
    """The entry points of a group, by their names.

    Ends the process with one line where those of any package cannot be read.
    """
    try:
        return sorted(importlib.metadata.entry_points(group=f"alignerf.{group}"))
    except Exception:
        for package in importlib.metadata.distributions():
            _, fault = tried(lambda one: one.entry_points, package)
            if fault:
                sys.exit(f"error: entry_points.txt of {called(package)}: {fault}")
        raise


def called(package):
    """The name of a package; where it says none, the path of what says so."""
    name, _ = tried(lambda: package.name)
    return name or getattr(package, "_path", "a package")


def tried(function, *arguments):
    """(what code of others returns, None), or (None, in words what it raises).

    It may end the process, too; a user's interrupt is none of its own.
    """
    try:
        return function(*arguments), None
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        return None, " ".join(f"{type(error).__name__}: {error}".split())


def taken(point, needed):
    """The object of an entry point; TypeError where it has not all that is needed."""
    one = point.load()
    for name in needed:
        fields = getattr(one, "model_fields", {})
        is_field = isinstance(fields, dict) and name in fields
        value = fields[name].default if is_field else getattr(one, name)
        if not isinstance(value, KINDS.get(name, object)):
            raise TypeError(f"{name} is a {type(value).__name__}")
    return one


def check_new(group, names, taken):
    """End the process with one line where a name is taken, or stands twice."""
    seen = set(taken)
    for name in names:
        if name in seen:
            sys.exit(f"error: alignerf.{group}: {name} is a name that is taken")
        seen.add(name)


@functools.cache
def registered(package, group, name):
    """All records of a registry: (those of its folder, then of other packages).

    package: the registry's folder as imported, whose every module with a global `name`
    holds one record, or a list of them. group: the entry points by which other packages
    add theirs. A new file in the folder is all that a new record takes. In the order of
    `order`, which a record may have (0 without), then of the modules' names.
    """
    records = []
    for module in sorted(m.name for m in pkgutil.iter_modules(package.__path__)):
        found = getattr(
            importlib.import_module(f"{package.__name__}.{module}"), name, []
        )
        records += found if isinstance(found, list) else [found]
    records.sort(key=lambda record: getattr(record, "order", 0))
    return (*records, *of_group(group).values())


@functools.cache
def names(group):
    """The names alone: nothing is imported for them."""
    return tuple(point.name for point in points(group))


def modules(group, name):
    """Those of the entry points of a name; none of what the program has itself."""
    return [point.module for point in points(group) if point.name == name]


@functools.cache
def root_of(package):
    """The folder in which a package lies that has entry points; None of any other."""
    every = (point.module for group in NEEDED for point in points(group))
    if package not in {module.partition(".")[0] for module in every}:
        return None
    # None where there is no such module: `of_group` says so.
    spec, _ = tried(lambda: importlib.util.find_spec(package))
    places = spec and (spec.submodule_search_locations or [spec.origin])
    return Path(places[0]).parent if places else None
