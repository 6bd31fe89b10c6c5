"""Reading YAML strictly: equal keys are a fault, and so are aliases without number."""

import itertools
import math

import yaml

from alignerf.io import faults

# Of a file: PyYAML reads 12 MB of comments for minutes.
MAX_BYTES = 2**20
# Of all that its aliases stand for: 540 bytes of them can stand for a billion values.
MAX_VALUES = 100_000


class Loader(yaml.SafeLoader):
    """A loader of mappings whose keys stand once: YAML would take the last."""

    def get_single_node(self):
        node = super().get_single_node()
        if values_of(node, {}) > MAX_VALUES:
            raise ValueError(f"over {MAX_VALUES:,} values, aliases among them")
        return node

    def construct_mapping(self, node, deep=False):
        seen = {"<<"}
        for key, _ in node.value:
            # Keys may be lists.
            if isinstance(key.value, str) and key.value in seen - {"<<"}:
                line = key.start_mark.line + 1
                raise ValueError(f"key {key.value!r} stands twice, see line {line}")
            seen |= {key.value} if isinstance(key.value, str) else set()
        return super().construct_mapping(node, deep)


def values_of(node, known):
    """How many values a node stands for; without end where it holds itself.

    known: {node: how many}, of those that were counted.
    """
    if node not in known:
        known[node] = math.inf
        inside = node.value if isinstance(node, yaml.CollectionNode) else ()
        if isinstance(node, yaml.MappingNode):
            inside = itertools.chain.from_iterable(inside)
        known[node] = 1 + sum(values_of(part, known) for part in inside)
    return known[node]


def read(path):
    """The content of a file; ValueError names the file, and its line for equal keys."""
    try:
        return yaml.load(faults.text(path, MAX_BYTES), Loader)
    except faults.Named:
        raise
    except RecursionError:
        raise ValueError(f"{path}: nested too deeply") from None
    except (yaml.YAMLError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: {' '.join(str(error).split())}") from None
