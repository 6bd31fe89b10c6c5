"""Rows on a command line: NamedTuples as JSON, written by rules, read by commands."""

import json

import pydantic

# Nothing is converted: a number is no text.
STRICT = pydantic.ConfigDict(strict=True)


def as_json(rows):
    """Rows as JSON, canonical: a key for each field but those that have their default.

    None for a row without a default.
    """
    return json.dumps(plain(rows), sort_keys=True)


def plain(value):
    """Rows, in lists or not, as mappings; other values as they are."""
    if hasattr(value, "_fields"):
        defaults = value._field_defaults
        return {
            name: plain(entry)
            for name, entry in value._asdict().items()
            if name not in defaults or entry != defaults[name]
        }
    return [plain(one) for one in value] if isinstance(value, list) else value


def read(kind, text, option="--rows", *, least=1):
    """Rows of a kind that a command's option holds, `least` or more.

    Raises ValueError naming a key too many or too few, and wrong values.
    """
    rows = pydantic.TypeAdapter(list[kind], config=STRICT)
    try:
        values = rows.validate_json(text)
    except pydantic.ValidationError as error:
        first = error.errors(include_url=False)[0]
        where = "".join(map(place, first["loc"]))
        raise ValueError(f"{option}{where}: {first['msg']}") from None
    if len(values) < least:
        raise ValueError(f"{option}: no row")
    return values


def place(part):
    """A part of the way to a value, as Python writes it."""
    return f"[{part}]" if isinstance(part, int) else f".{part}"
