"""What other packages add to the program: Python's entry points, by group.

A package names its objects under `alignerf.captures`, `alignerf.methods`,
`alignerf.causes`, `alignerf.test_sets`, `alignerf.systems` or `alignerf.estimators`;
CONTRIBUTING.md shows one of each.
"""

import functools
import hashlib
import importlib
import importlib.metadata
import importlib.util
import pkgutil
import sys
from pathlib import Path

# {group: what its objects must have}.
NEEDED = {
    "captures": ("name", "what", "poses", "detect", "read"),
    "methods": ("key", "annotation", "field", "trainings", "words", "moves"),
    "causes": ("name", "label", "unit", "value", "limit", "find", "order", "explains"),
    "test_sets": ("name", "pixels", "meaning", "needs", "make", "tables"),
    "systems": ("made", "kind", "near", "samples", "training"),
    "estimators": ("calculate", "min_side_px"),
}


@functools.cache
def of_group(group):
    """{name: object} of what other packages have under `alignerf.<group>`.

    Ends the process with one line where one cannot be imported, or has the name of
    another.
    """
    points = sorted(importlib.metadata.entry_points(group=f"alignerf.{group}"))
    objects = {}
    for point in points:
        of = f"alignerf.{group} of {point.dist.name if point.dist else 'a package'}"
        where = f"error: entry point {point.name} = {point.value} of {of}"
        if point.name in objects:
            sys.exit(f"{where}: another package has the same name")
        try:
            objects[point.name] = point.load()
        # Whatever the code of others raises.
        except Exception as error:
            what = " ".join(f"{type(error).__name__}: {error}".split())
            sys.exit(f"{where}: {what}")
        if lacking := [
            name for name in NEEDED[group] if not has(objects[point.name], name)
        ]:
            sys.exit(f"{where}: it has no {lacking[0]}")
    return objects


def has(one, name):
    """Whether an object has an attribute, or one of an attribute: `Keys.near`."""
    for part in name.split("."):
        fields = getattr(one, "model_fields", {})
        if part not in fields and not hasattr(one, part):
            return False
        one = getattr(one, part, None)
    return True


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
    points = importlib.metadata.entry_points(group=f"alignerf.{group}")
    return tuple(sorted(point.name for point in points))


@functools.cache
def digest():
    """SHA-256 of all entry points and of the code behind them.

    That is every module of the folders in which they lie: a change of one is a change
    of the program.
    """
    code = hashlib.sha256()
    for group in NEEDED:
        for point in sorted(importlib.metadata.entry_points(group=f"alignerf.{group}")):
            code.update(f"{group} {point.name} {point.value}\n".encode())
            for path in modules_beside(point.module):
                code.update(path.read_bytes())
    return code.digest()


def modules_beside(module):
    """The files of a module and of its folder; of a module in no package its own."""
    try:
        spec = importlib.util.find_spec(module)
    # `of_group` says what is wrong with it.
    except Exception:
        return []
    if spec is None or not spec.origin:
        return []
    path = Path(spec.origin)
    return sorted(path.parent.rglob("*.py")) if "." in module else [path]
