"""Mappings as classes of keys: checked, with one line for a fault, and filled."""

import difflib
import math
import re

import pydantic

from alignerf.experiment.keys import key as keys
from alignerf.io import faults

# What pydantic calls a dictionary, an instance or an object.
MAPPING = "be a mapping of keys"
# Of more letters the values that a key takes are counted, and the nearest named.
LONG = 600
WORDS = dict.fromkeys(("dict_type", "model_type", "model_attributes_type"), MAPPING)


def check(kind, values, *place):
    """An instance of a class of keys; ValueError for the first key it does not take.

    place: the keys above `values`.
    """
    try:
        return kind.model_validate(values)
    except pydantic.ValidationError as error:
        errors = error.errors(include_url=False)
        raise ValueError(message(errors, values, place)) from None


def message(errors, values, place):
    """One line: the key, what is wrong with it and, of YAML's traps, how to fix it."""
    # A misspelt key before the one that it leaves out.
    error, *_ = sorted(errors, key=lambda one: one["type"] != "value_error")
    inner = place_of(error, values)
    where = ".".join(map(str, (*place, *inner))) or "top level"
    if error["type"] == "value_error":
        # What begins with a key of the section continues its place.
        text = str(error["ctx"]["error"])
        named = all(map(str.isidentifier, text.partition(": ")[0].split(".")))
        if ": " in text and named:
            return f"config: {'.'.join(map(str, (*place, *inner, text)))}"
        return f"config: {where}: {text}"
    if error["type"] == "missing":
        return f"config: {where}: {error['loc'][-1]!r} is missing"
    value = error["input"]
    if error["type"] == "union_tag_invalid":
        kind, kinds = faults.shown(value["kind"], 100), error["ctx"]["expected_tags"]
        return f"config: {where}.kind: {kind} should be one of {kinds}"
    # Of all that a key may be, each says what it misses.
    same = [one for one in errors if place_of(one, values) == inner]
    what = " or ".join(dict.fromkeys(map(wanted, same)))
    said = f"{faults.shown(value, 100)} should {what}{hint_of(value, what)}"
    return f"config: {where}: {said}"


def place_of(error, values):
    """Keys of what an error is about, without what pydantic calls parts of a type."""
    *loc, last = error["loc"] or [None]
    place = []
    for part in loc[:-1] if last == "[key]" else [*loc, last]:
        try:
            values = values[part]
        except (KeyError, IndexError, TypeError):
            continue
        place.append(part)
    return place


def wanted(error):
    """What a value should be, in pydantic's words."""
    _, _, what = error["msg"].replace(" after validation", "").partition(" should ")
    if error["type"] == "literal_error" and len(what) > LONG:
        names = re.findall("'([^']*)'", what)
        near = difflib.get_close_matches(str(error["input"])[:100], names, 5, 0.0)
        what = f"be one of {len(names)} names, such as {', '.join(map(repr, near))}"
    return WORDS.get(error["type"], what or f"be valid: {error['msg']}")


def hint_of(value, what):
    """How to write a number that is text: quoted, or without the point YAML wants.

    Or what a value of an earlier version is called now.
    """
    if isinstance(value, str) and value in keys.RENAMED_VALUES:
        return f"; it is {keys.RENAMED_VALUES[value]!r} now"
    if isinstance(value, str) and (by := keys.READ_BY.get(value)) and repr(by) in what:
        return f"; for data of {value} it is {by!r}"
    if not isinstance(value, str) or not value.isascii() or not is_finite(value):
        return ""
    if "valid integer" in what and value.isdecimal():
        return f" (as a number: {value[:100]} without quotes)"
    if "valid number" in what:
        return f" (YAML reads {value[:100]} as text: write {float(value):.1e})"
    return ""


def is_finite(text):
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False
