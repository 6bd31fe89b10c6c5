"""The registry of test sets: own.yaml, and lists TEST_SETS of modules of this folder.

A new entry or file is all that a new test set takes: `alignerf.evaluate` scores it,
rule `control_sets` writes its images, tables show it, docs/reference/files.md lists it.
"""

import functools
import sys

from alignerf.io.environment import extensions
from alignerf.testsets.base import NEEDS, TABLES, TestSet


@functools.cache
def every():
    """All of them in the tables' order, those of other packages last."""
    sets = extensions.registered(sys.modules[__name__], "test_sets", "TEST_SETS")
    extensions.check_new("test_sets", [one.name for one in sets], ())
    for one in sets:
        wrong = [one.needs] * (one.needs not in NEEDS) + sorted({*one.tables} - TABLES)
        if wrong:
            what = f"error: alignerf.test_sets: {one.name}: unknown word {wrong[0]!r}"
            sys.exit(what)
    return tuple(sorted(sets, key=lambda one: one.order))


def named(name) -> TestSet:
    """The test set of a name."""
    return next(one for one in every() if one.name == name)


def shown_in(table):
    """Names of those that a table shows, in its order."""
    return [one.name for one in every() if table in one.tables]


def drawn():
    """The control sets: those whose images are made beside the warped photos."""
    return [one for one in every() if one.draw]


def image_folders():
    """Folders beside the warped photos that are written for control sets."""
    return [folder for one in drawn() for folder in one.images or (one.name,)]


def fairest(known, moves=frozenset()):
    """The name, among those known, by which a method is judged most fairly.

    moves: what it changes of what it learns from: `cameras`, `photos`. Where no known
    set is fair for it, the one that is preferred; None where none is to judge by.
    """
    ranked = [one for one in every() if one.name in known and one.preference]
    ranked.sort(key=lambda one: (not one.fair_for >= set(moves), one.preference))
    return ranked[0].name if ranked else None


def is_unfair(name, moves):
    """Whether a set of this name is unfair to a method that moves these."""
    return any(one.name == name and not one.fair_for >= set(moves) for one in every())


def against(name):
    """What a gain by a set of this name is measured against, in words; "" of others."""
    return next((one.against for one in every() if one.name == name), "")


def markdown():
    """The list for docs/reference/files.md."""
    lines = [("test set", "pixels", "what a render is compared with"), ["---"] * 3]
    lines += [(f"`{one.name}`", one.pixels, one.meaning) for one in every()]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
