"""The JSON schema of the classes of keys, and the one validator that reads it."""

import dataclasses
import functools
import math
import types
import typing
from typing import Literal

import jsonschema

# Of models, methods and variants: they become folders, and columns of tables.
NAME = r"^[A-Za-z0-9][A-Za-z0-9_]{0,99}\Z"
TYPES = {int: "integer", float: "number", bool: "boolean", str: "string"}
BOUNDS = {"least": "minimum", "most": "maximum", "above": "exclusiveMinimum"}


def name_of(field):
    """The key of a field; `from_` stands for a word that Python keeps for itself."""
    return field.name.rstrip("_")


def root(kind):
    """The whole schema of a class, with those of all that it refers to."""
    defs, todo = {}, list(classes_in(kind))
    while todo:
        part = todo.pop()
        if part.__name__ not in defs:
            defs[part.__name__] = of_class(part)
            todo += classes_in(part)
    return of_class(kind) | {"$defs": dict(sorted(defs.items()))}


def classes_in(kind):
    """Classes that the fields of one refer to."""
    todo = list(typing.get_type_hints(kind).values())
    while todo:
        hint = todo.pop()
        if dataclasses.is_dataclass(hint) or hasattr(hint, "properties"):
            yield hint
        elif typing.get_origin(hint) is not Literal:
            todo += typing.get_args(hint)


def of_class(kind):
    """Schema of a mapping with the fields of a class of keys.

    One of which any part may be given says its properties itself.
    """
    if hasattr(kind, "properties"):
        least = {"minProperties": kind.LEAST} if kind.LEAST else {}
        return mapping_of(kind.properties(of_class), **least)
    hints = typing.get_type_hints(kind)
    fields = dataclasses.fields(kind)
    properties = {name_of(f): of_field(f, hints[f.name]) for f in fields}
    whole = mapping_of(properties)
    if required := [name_of(f) for f in fields if is_required(f)]:
        whole["required"] = required
    return whole


def mapping_of(properties, **more):
    """Schema of a mapping with these keys and no other."""
    closed = {"type": "object", "additionalProperties": False}
    return closed | more | {"properties": properties}


def is_required(field):
    both = (field.default, field.default_factory)
    return both == (dataclasses.MISSING, dataclasses.MISSING)


def of_field(field, hint):
    """Schema of one key: its type's, its meaning, its bounds and its default."""
    bounds = dict(field.metadata)
    found = {"description": bounds.pop("what")} if field.metadata["what"] else {}
    bounds.pop("what", None)
    found |= of_type(hint, bounds)
    if not is_required(field) and not is_default_of_its_class(field):
        found["default"] = default_of(field)
    return found


def is_default_of_its_class(field):
    """Whether a key's default is that of the class it refers to, said there."""
    found = raw_default(field)
    return dataclasses.is_dataclass(found) and found == type(found)()


def default_of(field):
    """A field's default as it stands in a config."""
    found = raw_default(field)
    return as_config(found) if dataclasses.is_dataclass(found) else found


def raw_default(field):
    """A field's default as its class has it."""
    if field.default_factory is dataclasses.MISSING:
        return field.default
    return field.default_factory()


def as_config(instance):
    """An instance of a class of keys as a mapping with the config's keys."""
    found = {}
    for field in dataclasses.fields(instance):
        value = getattr(instance, field.name)
        if dataclasses.is_dataclass(value):
            value = as_config(value)
        # A list of its own: another config's changes are not this one's.
        found[name_of(field)] = list(value) if isinstance(value, list) else value
    return found


def of_type(hint, bounds):
    """Schema of a type: plain, list, mapping, class, or one of several."""
    if typing.get_origin(hint) in (types.UnionType, typing.Union):
        return of_union(typing.get_args(hint), bounds)
    if typing.get_origin(hint) is Literal:
        return {"enum": list(typing.get_args(hint))}
    if typing.get_origin(hint) is list:
        return of_list(*typing.get_args(hint), bounds)
    if typing.get_origin(hint) is dict:
        return of_names(typing.get_args(hint)[1])
    if hint not in TYPES:
        return {"$ref": f"#/$defs/{hint.__name__}"}
    limits = {BOUNDS[key]: bounds[key] for key in BOUNDS if key in bounds}
    pattern = {"pattern": bounds["pattern"]} if "pattern" in bounds else {}
    return {"type": TYPES[hint], **limits, **pattern}


def of_list(item, bounds):
    found = {"type": "array", "items": of_type(item, bounds)}
    least, most = bounds.get("length", (0, 1000))
    return found | {"minItems": least, "maxItems": most}


def of_names(kind):
    """A mapping from names to instances of a class."""
    pattern = getattr(kind, "NAME", NAME)
    return {
        "type": "object",
        "minProperties": 1,
        "maxProperties": 10000,
        "propertyNames": {"pattern": pattern},
        "additionalProperties": of_type(kind, {}),
    }


def of_union(options, bounds):
    """Null or a type; a number or a word; one kind of field or the other."""
    kinds = [option for option in options if option is not type(None)]
    if all("kind" in getattr(kind, "__dataclass_fields__", ()) for kind in kinds):
        # Without a `kind` a model is of the first; a field may change another of any.
        usual = getattr(kinds[0], "USUAL_KIND", False)
        return of_kinds(kinds, kinds[0] if usual else None)
    found = [of_type(option, bounds) for option in kinds]
    if type(None) not in options:
        return {"oneOf": found}
    (only,) = found
    if "enum" in only:
        return {"enum": [*only["enum"], None]}
    if "$ref" in only:
        null = {"type": ["object", "null"]}
        return null | {"if": {"type": "object"}, "then": only}
    return only | {"type": [only["type"], "null"]}


def of_kinds(kinds, default=None):
    """By `kind`; without it, the keys of the default one, or of any."""
    by_kind = kinds_by_name(kinds)
    every = {
        key: entry
        for kind in ([default] if default else kinds)
        for key, entry in of_class(kind)["properties"].items()
    }
    choice = {"kind": {"enum": list(by_kind)}}
    cases = [
        {
            "if": {"required": ["kind"], "properties": {"kind": {"const": name}}},
            "then": {"$ref": f"#/$defs/{kind.__name__}"},
        }
        for name, kind in by_kind.items()
    ]
    free = {"additionalProperties": False, "properties": every | choice}
    return {
        "type": "object",
        "properties": choice,
        "if": {"not": {"required": ["kind"]}},
        "then": free,
        "allOf": cases,
    }


def kinds_by_name(kinds):
    """{`kind` as a config has it: class} of fields or models."""
    return {kind.__dataclass_fields__["kind"].default: kind for kind in kinds}


def is_whole(checker, value):
    """A whole number that is written as one: 2.0 steps would fail only later."""
    return isinstance(value, int) and not isinstance(value, bool)


# As Draft 2020-12, which calls 2.0 an integer.
Validator = jsonschema.validators.extend(
    jsonschema.Draft202012Validator,
    type_checker=jsonschema.Draft202012Validator.TYPE_CHECKER.redefine(
        "integer", is_whole
    ),
)


@functools.cache
def validator_of(kind):
    return Validator(root(kind))


def check(kind, values, *place):
    """ValueError for the first key of `values` that the class does not take.

    place: the keys above `values`.
    """
    check_finite(values, place)
    errors = validator_of(kind).iter_errors(values)
    errors = sorted(errors, key=lambda e: list(map(str, e.path)))
    if errors:
        error = jsonschema.exceptions.best_match(errors)
        raise ValueError(message(error, place))


def message(error, place):
    """One line: the key, what is wrong with it and, of YAML's traps, how to mend it."""
    where = ".".join(map(str, (*place, *error.absolute_path))) or "top level"
    value, hint = error.instance, ""
    is_text = error.validator == "type" and isinstance(value, str) and value.isascii()
    if is_text and is_number(value):
        hint = f" (YAML reads {value} as text: write {float(value):.1e})"
    text = error.message if len(error.message) < 300 else error.message[:300] + "..."
    return f"config: {where}: {text}{hint}"


def is_number(text):
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def check_finite(value, place):
    """No bound refuses NaN, which is neither above nor below it."""
    if isinstance(value, dict):
        for name, entry in value.items():
            check_finite(entry, (*place, name))
    elif isinstance(value, list):
        for number, entry in enumerate(value):
            check_finite(entry, (*place, number))
    elif isinstance(value, float) and not math.isfinite(value):
        where = ".".join(map(str, place))
        raise ValueError(f"config: {where}: {value} is not a finite number")


def filled(kind, values, base=None):
    """The values of a config's mapping, and the default of every key that it leaves.

    base: an instance whose values are the defaults, where those are not the class's.
    """
    hints = typing.get_type_hints(kind)
    found = {}
    for field in dataclasses.fields(kind):
        default = None
        if base is not None:
            default = getattr(base, field.name)
        elif not is_required(field):
            default = raw_default(field)
        value = values.get(name_of(field), default)
        found[name_of(field)] = filled_value(hints[field.name], value, default)
    return found


def filled_value(hint, value, default):
    """A value whose mappings are filled in turn."""
    if dataclasses.is_dataclass(value):
        return as_config(value)
    if isinstance(value, list):
        return list(value)
    if not isinstance(value, dict):
        return value
    if typing.get_origin(hint) is dict:
        kind = typing.get_args(hint)[1]
        return {name: filled_value(kind, entry, None) for name, entry in value.items()}
    if hasattr(hint, "properties"):
        return dict(value)
    kinds = [k for k in typing.get_args(hint) or (hint,) if k is not type(None)]
    if len(kinds) > 1 and "kind" in value:
        kinds, default = [kinds_by_name(kinds)[value["kind"]]], None
    elif len(kinds) > 1:
        kinds = [type(default)] if dataclasses.is_dataclass(default) else kinds[:1]
    base = default if dataclasses.is_dataclass(default) else None
    return filled(kinds[0], value, base)
