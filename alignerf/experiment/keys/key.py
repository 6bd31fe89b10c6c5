"""What a key is: a field with its default, its meaning and its bounds."""

import dataclasses

# Of a key that every config has to give.
REQUIRED = dataclasses.MISSING


def key(default=REQUIRED, what="", **bounds):
    """A field of a class of keys: its default, its meaning, its bounds."""
    metadata = {"what": what, **bounds}
    if default is REQUIRED:
        return dataclasses.field(metadata=metadata)
    if isinstance(default, list | dict) or dataclasses.is_dataclass(default):
        return dataclasses.field(default_factory=lambda: default, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def learning_rates(first, last):
    what = "first and last, log-linear between"
    return key([first, last], what, above=0, most=10, length=(2, 2))


def budget(what):
    return key(None, what, above=0, most=14400)


def left_to_facts(*names):
    what = "keys that the scene's facts decide: all that a config with `decide` lacks"
    return key([], what, length=(0, len(names)))
