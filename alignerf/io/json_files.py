"""Reading JSON of ours: whatever is wrong with a file is a ValueError that names it."""

import json

from alignerf.io import faults

LARGEST = 1e300
# Of a list, such as the frames of a scene, and of all that a file holds.
MAX_ENTRIES, MAX_VALUES = 100_000, 5_000_000
NUMBER = (int, float)
NUMBER_OR_NONE = (int, float, type(None))


def canonical(value):
    """Text of a value: equal values are equal text."""
    return json.dumps(value, sort_keys=True)


def read(path, kinds=None):
    """The object in a file.

    kinds: {key: its type, or several} of keys that it must have; numbers among them are
    finite, and lists have at most MAX_ENTRIES. Raises ValueError naming the file, and
    the key, for anything else.
    """
    return _read(path, lambda content: check(content, kinds or {}))


def read_list(path):
    """The list in a file; raises as `read`."""

    def is_list(content):
        check({"it": content}, {"it": list})

    return _read(path, is_list)


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


def check(content, kinds):
    """ValueError where the content is no object, or a key not of its kind."""
    if not isinstance(content, dict):
        raise ValueError("not an object")
    for key, kind in kinds.items():
        if key not in content:
            raise ValueError(f"no {key} in it")
        value = content[key]
        # Python calls True a number.
        is_truth = isinstance(value, bool) and kind is not bool
        if is_truth or not isinstance(value, kind):
            raise ValueError(f"{key} is {faults.shown(value)}")
        if isinstance(value, list) and len(value) > MAX_ENTRIES:
            raise ValueError(f"{key}: {len(value):,} entries, over {MAX_ENTRIES:,}")
        # A whole number of 400 digits has no floating one.
        if isinstance(value, NUMBER) and not abs(value) < LARGEST:
            raise ValueError(f"{key} is {faults.shown(value)}")
