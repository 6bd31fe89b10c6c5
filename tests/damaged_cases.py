"""A JSON with another value in one of its places, or with none there."""

import copy

GONE = object()
VALUES = [None, True, 0, -1, 10**12, 10**400, 1.5, float("nan"), float("inf"), "x", ""]
VALUES += [[], [1], ["x"], {}, {"x": 1}, {"01": 10**12}, {"01": None}, GONE]


def places(value, at=()):
    """The way to each value in a JSON."""
    yield at
    inside = value.items() if isinstance(value, dict) else ()
    inside = enumerate(value) if isinstance(value, list) else inside
    for key, entry in inside:
        yield from places(entry, (*at, key))


def changed(value, at, new):
    """A copy with another value in a place, or with none there."""
    if not at:
        return new
    value = part = copy.deepcopy(value)
    for key in at[:-1]:
        part = part[key]
    if new is GONE:
        del part[at[-1]]
    else:
        part[at[-1]] = new
    return value
