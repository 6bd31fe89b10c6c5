"""The registry of causes: what can be wrong with a scene, a file each.

A file has one `base.Cause` as `CAUSE`, or a list of them. A new file in this folder, or
a record of another package under the entry points `alignerf.causes`, is all that a new
cause takes. Limits are fitted to planted faults, and judged by captures that were left
out: docs/evidence/verdict.md.
"""

import functools
import graphlib
import sys

from alignerf.causes import pairs
from alignerf.io.environment import extensions


def every():
    """All causes, in the order in which they are shown."""
    return extensions.registered(sys.modules[__name__], "causes", "CAUSE")


def find(e):
    """A `base.Finding` of each cause that applies to an Evidence, the gravest first.

    Causes compete: what one explains is no evidence for another (`spoilt`).
    """
    if e.pairs.stops:
        # Too many pairs that are none: nothing else can be told.
        return [pairs.PAIRS.find(e)]
    found = []
    for cause in in_turn():
        finding = cause.find(e)
        if finding and cause.name not in spoilt(e, found):
            found.append(finding)
    return sorted(found, key=lambda finding: finding.cause.order[1])


@functools.cache
def in_turn():
    """All causes, each after those that explain it, the gravest first."""
    by_name = {cause.name: cause for cause in sorted(every(), key=lambda c: c.order[1])}
    before = {name: set() for name in by_name}
    for cause in by_name.values():
        for name in set(cause.explains) & set(by_name) - {cause.name}:
            before[name].add(cause.name)
    try:
        order = [*graphlib.TopologicalSorter(before).static_order()]
    except graphlib.CycleError as error:
        ring = ", ".join(error.args[1])
        raise ValueError(f"causes explain one another in a ring: {ring}") from None
    return [by_name[name] for name in order]


def spoilt(e, findings):
    """{name: the `base.Finding` that spoils its evidence} of causes that are not told.

    A cause that stands by other evidence is told.
    """
    explained = {
        name: finding
        for finding in reversed(findings)
        if finding.cause.explains and finding.cause.explains_now(e)
        for name in finding.cause.explains
    }
    by_name = {cause.name: cause for cause in in_turn()} if explained else {}
    return {
        name: finding
        for name, finding in explained.items()
        if name in by_name and not by_name[name].stands(e)
    }
