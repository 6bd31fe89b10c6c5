"""Reading JSON of ours: whatever is wrong with a file is a ValueError that names it."""

import dataclasses
import json

from alignerf.io import faults

LARGEST = 1e300
# Of a list, such as the frames of a scene, and of all that a file holds.
MAX_ENTRIES, MAX_VALUES = 100_000, 5_000_000
NUMBER = (int, float)
NUMBER_OR_NONE = (int, float, type(None))


@dataclasses.dataclass(frozen=True)
class OrNone:
    """The kind of a value that may be null, or not be there."""

    kind: object

    def __call__(self, value):
        return type(None) if value is None else self.kind


def positive(value):
    """The kind of a number above 0."""
    return NUMBER if isinstance(value, NUMBER) and value > 0 else ()


def one_of(*values):
    """The kind of a value that is one of these."""
    return lambda value: next((type(o) for o in values if o is value or o == value), ())


def list_of(count, kind):
    """The kind of a list of so many."""
    return lambda value: (
        [kind] if isinstance(value, list) and len(value) == count else ()
    )


def vector(count):
    """The kind of a list of so many numbers."""
    return list_of(count, NUMBER)


def matrix(columns, *rows):
    """The kind of a list of so many rows, or so many, of numbers."""
    return lambda value: (
        [vector(columns)] if isinstance(value, list) and len(value) in rows else ()
    )


def canonical(value):
    """Text of a value: equal values are equal text."""
    return json.dumps(value, sort_keys=True)


def of_config(text):
    """A stage's slice of the config: a JSON object, or the path of a file of one."""
    if not text.lstrip().startswith("{"):
        text = faults.text(text)
    try:
        found = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"--config is not JSON: {error}") from None
    if not isinstance(found, dict):
        raise ValueError("--config must be a JSON object")
    return found


def read(path, kinds=None):
    """The object in a file.

    kinds: {key: its kind} of keys that it must have, or {str: that of all}. A kind is a
    type, or several; of an object its own kinds; of a list, in a list, that of its
    entries; or a function from the value to its kind. Numbers are finite, and lists
    have at most MAX_ENTRIES. Raises ValueError naming the file, and the key, for
    anything else.
    """
    return _read(path, lambda content: check(content, kinds or {}))


def read_list(path, kind=object):
    """The list in a file, of entries of a kind; raises as `read`."""
    return _read(path, lambda content: check_value(content, [kind], "entry"))


def _read(path, check_it):
    """What a file holds, once it is checked."""
    try:
        text = faults.text(path)
        # By its commas and brackets, before any of them takes memory.
        if sum(map(text.count, ",[{")) > MAX_VALUES:
            raise ValueError(f"over {MAX_VALUES:,} values")
        content = json.loads(text)
        check_it(content)
    except faults.Named:
        raise
    except RecursionError:
        raise ValueError(f"{path}: nested too deeply") from None
    except ValueError as error:
        raise ValueError(f"{path}: not the JSON that it should be: {error}") from None
    return content


def check(content, kinds, where=""):
    """ValueError where the content is no object, or a key not of its kind.

    where: of the object in the file, as `causes[0]`.
    """
    at = f"{where}: " if where else ""
    if not isinstance(content, dict):
        raise ValueError(f"{at}not an object")
    for key, kind in kinds.items():
        if key is str:
            check(content, dict.fromkeys(content, kind), where)
        elif key in content:
            check_value(
                content[key], kind, f"{where}.{faults.name_of(key)}" if where else key
            )
        elif not isinstance(kind, OrNone):
            raise ValueError(f"{at}no {key} in it")


def check_value(value, kind, where):
    """ValueError where a value is not of its kind."""
    while callable(kind) and not isinstance(kind, type):
        kind = kind(value)
    if isinstance(kind, dict):
        check(value, kind, where)
        return
    each, kind = (kind, list) if isinstance(kind, list) else ((), kind)
    # Python calls True a number.
    is_truth = isinstance(value, bool) and kind is not bool
    if is_truth or not isinstance(value, kind):
        raise ValueError(f"{where} is {faults.shown(value)}")
    if isinstance(value, list) and len(value) > MAX_ENTRIES:
        raise ValueError(f"{where}: {len(value):,} entries, over {MAX_ENTRIES:,}")
    # A whole number of 400 digits has no floating one.
    if isinstance(value, NUMBER) and not abs(value) < LARGEST:
        raise ValueError(f"{where} is {faults.shown(value)}")
    for of_entries in each:
        for i, entry in enumerate(value):
            check_value(entry, of_entries, f"{where}[{i}]")
