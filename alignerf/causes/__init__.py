"""The registry of causes: what can be wrong with a scene, a file each.

A file has one `base.Cause` as `CAUSE`, or a list of them: a function that finds it, and
the texts that tell it. A new file in this folder, or a record of another package under
the entry points `alignerf.causes`, is all that a new cause takes. Limits are fitted to
planted faults, and judged by captures that were left out: docs/evidence/verdict.md.
"""

import functools
import graphlib
import sys

from alignerf.causes import pairs
from alignerf.causes.shared import at_stake
from alignerf.io.environment import extensions


def every():
    """All causes."""
    return extensions.registered(sys.modules[__name__], "causes", "CAUSE")


def find(e):
    """A `base.Finding` of each cause that an Evidence has, in `order`."""
    return [one for one in examine(e) if one.sure is not None]


def order(one):
    """What sorts findings: the sure first, of these the one with most at stake."""
    known = one.at_stake is not None
    place = every().index(one.cause)
    return one.sure is None, not one.sure, not known, known and -one.at_stake[1], place


def examine(e):
    """A `base.Finding` of each cause that is looked for, in `order`.

    Causes compete: what one explains is no evidence for another, unless that stands by
    other evidence.
    """
    found = []
    for cause in in_turn():
        if (one := cause.find(e)) is None:
            continue
        if e.pairs.stops and cause is not pairs.PAIRS:
            # Too many pairs that are none: nothing else can be told.
            one = one._replace(sure=None, detectable=False)
        by = [
            other
            for other in found
            if other.sure is not None and other.explains and not one.stands
            if cause.name in other.cause.explains
        ]
        if by:
            one = one._replace(sure=None, spoilt=min(by, key=order).cause.spoils)
        stake = at_stake.of(cause.name, one.size) if one.sure is not None else None
        photos = tuple(one.photos or e.photos.get(cause.name, ()))
        found.append(one._replace(cause=cause, at_stake=stake, photos=photos))
    return sorted(found, key=order)


@functools.cache
def in_turn():
    """All causes, each after those that explain it."""
    by_name = {cause.name: cause for cause in every()}
    before = {name: [] for name in by_name}
    for cause in by_name.values():
        for name in set(cause.explains) & set(by_name) - {cause.name}:
            before[name].append(cause.name)
    try:
        order = [*graphlib.TopologicalSorter(before).static_order()]
    except graphlib.CycleError as error:
        ring = ", ".join(error.args[1])
        raise ValueError(f"causes explain one another in a ring: {ring}") from None
    return [by_name[name] for name in order]
