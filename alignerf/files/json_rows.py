"""Rows on a command line: NamedTuples as JSON, written by rules, read by commands."""

import json
import typing


def as_json(rows):
    """Rows as JSON, canonical: a key for each field.

    None for one without a default; one that has its default is left out.
    """
    return json.dumps(plain(rows), sort_keys=True)


def plain(value):
    """The same before it is text."""
    if is_row(value):
        defaults = value._field_defaults
        return {
            name: plain(found)
            for name, found in value._asdict().items()
            if name not in defaults or found != defaults[name]
        }
    return [plain(one) for one in value] if isinstance(value, list) else value


def read(kind, text, option="--rows"):
    """Rows of a kind that a command's option holds.

    Raises ValueError naming a key too many or too few, and wrong values.
    """
    try:
        found = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"{option} is not JSON: {error}") from None
    if not (rows := typed(list[kind], found, option)):
        raise ValueError(f"{option}: no row")
    return rows


def typed(hint, value, where):
    """A value as its hint says: rows of mappings, in lists or not; others as is."""
    if is_row(hint):
        return row_of(hint, value, where)
    plain_hint = typing.get_origin(hint) or hint
    if plain_hint in (typing.Union, type(int | str)):
        plain_hint = hint
    if not isinstance(value, plain_hint):
        name = getattr(hint, "__name__", hint)
        raise ValueError(f"{where}: {name} was expected, not {value!r:.60}")
    if plain_hint is list:
        (of_each,) = typing.get_args(hint)
        return [typed(of_each, v, f"{where}[{i}]") for i, v in enumerate(value)]
    return value


def row_of(kind, values, where):
    """A row from a mapping that has its fields, those with a default if it likes."""
    if not isinstance(values, dict):
        raise ValueError(f"{where}: a mapping was expected, not {values!r:.60}")
    if unknown := sorted(values.keys() - set(kind._fields)):
        raise ValueError(f"{where}: unknown key {unknown[0]!r}")
    needed = [name for name in kind._fields if name not in kind._field_defaults]
    if missing := [name for name in needed if name not in values]:
        raise ValueError(f"{where}: no key {missing[0]!r}")
    hints = typing.get_type_hints(kind)
    return kind(
        **{
            name: typed(hints[name], value, f"{where}.{name}")
            for name, value in values.items()
        }
    )


def is_row(value):
    """Whether it is a NamedTuple, or a class of them."""
    return hasattr(value, "_fields")
