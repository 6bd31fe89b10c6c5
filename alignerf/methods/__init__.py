"""The registry of methods: one file each, which holds one record called METHOD.

All else asks the record of a method (`base.Method`), never its name. Other packages add
records by the entry points `alignerf.methods`; see CONTRIBUTING.md.
"""

import functools
import sys

import pydantic

from alignerf.io.environment import extensions


def every():
    """All records, in the order of their keys in a config."""
    return extensions.registered(sys.modules[__name__], "methods", "METHOD")


def parts_of(method):
    """The records of whose keys a method of the config has one; else the plain one."""
    found = [one for one in every() if one.key and getattr(method, one.key)]
    return found or [one for one in every() if one.key is None]


def unused(method):
    """Keys of records that a method of the config is not of."""
    return {o.key for o in every() if o.key and not getattr(method, o.key)}


def of_method(method):
    """The record of a method; where it has several, the last one trains it."""
    return parts_of(method)[-1]


def moves(method, round=None):
    """What a method changes of what it learns from: `cameras`, `photos`, both, neither.

    round: what it has changed by then; None: by its last.
    """
    return frozenset().union(*(one.moves(method, round) for one in parts_of(method)))


def label(experiment, name):
    """How a table calls a method: its field, and what else the method is."""
    parts = parts_of(experiment.methods[name])
    words = [word for one in parts for word in one.words(experiment, name)]
    return ", ".join([*parts[-1].subject(experiment, name), *words])


def has_scratch(chosen, model):
    """Whether one of these methods trains a model from scratch, and nothing more."""
    return any(of_method(m).from_scratch and m.model == model for m in chosen)


def input_cameras(experiment, scene, name):
    """{"cameras": path} of those that a method begins with, if not the scene's."""
    parts = parts_of(experiment.methods[name])
    return {k: v for one in parts for k, v in one.cameras(experiment, scene).items()}


def check(config, name):
    """Raises ValueError for what a method of the complete config cannot have."""
    for one in reversed(parts_of(config.methods[name])):
        one.check_beside(config, name)
        one.check(config, name)


@functools.cache
def keys_class(common, published):
    """The class of a method's keys: the common ones, those of all records, the last."""
    keys = [one.key for one in every() if one.key]
    extensions.check_new("methods", keys, ("published", *dir(common())))
    fields = {one.key: (one.annotation, one.field) for one in every() if one.key}
    fields["published"] = (str | None, published)
    return pydantic.create_model("Method", __base__=common, **fields)
