"""Reading YAML strictly: equal keys and endless aliases are faults."""

import contextlib

import yaml

from alignerf.files import faults

# Values of a file with all its aliases written out: more is a mistake, or an attack.
MOST_VALUES = 100_000
# Of a file: PyYAML reads 12 MB of comments for minutes.
MOST_BYTES = 2**20
# Of a number: Python writes no longer one, not even in a message.
MOST_DIGITS = 4300


def read(path):
    """The content of a file, after `check`; ValueError names the file."""
    node = check(path)
    with _faults_of(path):
        return node and yaml.SafeLoader("").construct_document(node)


def check(path):
    """The node of a file's content, or None.

    ValueError naming file and line for equal keys and for endless aliases.
    """
    text = faults.text(path, MOST_BYTES)
    with _faults_of(path):
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        size = 0 if node is None else values_of(node, path, {})
    if size > MOST_VALUES:
        raise ValueError(f"{path}: its aliases stand for over {MOST_VALUES} values")
    return node


@contextlib.contextmanager
def _faults_of(path):
    """Whatever is wrong with a file is a ValueError that names it, in one line."""
    try:
        yield
    except faults.Named:
        raise
    except RecursionError:
        raise ValueError(f"{path}: nested too deeply") from None
    except (yaml.YAMLError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None


def values_of(node, path, known):
    """How many values a YAML node stands for, aliases written out."""
    if id(node) in known:
        if known[id(node)] is None:
            line = node.start_mark.line + 1
            raise faults.Named(f"{path}: an alias holds itself, see line {line}")
        return known[id(node)]
    known[id(node)] = None
    size = 1
    if node.tag == "tag:yaml.org,2002:int" and len(node.value) > MOST_DIGITS:
        line = node.start_mark.line + 1
        raise faults.Named(f"{path}: over {MOST_DIGITS} digits, see line {line}")
    if isinstance(node, yaml.MappingNode):
        check_keys_once(node, path)
        size += sum(values_of(value, path, known) for _, value in node.value)
    elif isinstance(node, yaml.SequenceNode):
        size += sum(values_of(value, path, known) for value in node.value)
    known[id(node)] = size
    return size


def check_keys_once(node, path):
    """ValueError where two keys of a mapping are equal: YAML would take the last."""
    seen = set()
    for key, _ in node.value:
        # `<<` may stand more than once, and keys may be lists.
        if key.value in seen and isinstance(key.value, str):
            line = key.start_mark.line + 1
            raise faults.Named(
                f"{path}: key {key.value!r} stands twice, see line {line}"
            )
        if isinstance(key.value, str):
            seen.add(key.value)
