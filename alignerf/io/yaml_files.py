"""Reading YAML strictly: equal keys are a fault."""

import yaml

from alignerf.io import faults

# Of a file: PyYAML reads 12 MB of comments for minutes.
MAX_BYTES = 2**20


class Loader(yaml.SafeLoader):
    """A loader of mappings whose keys stand once: YAML would take the last."""

    def construct_mapping(self, node, deep=False):
        seen = {"<<"}
        for key, _ in node.value:
            # Keys may be lists.
            if isinstance(key.value, str) and key.value in seen - {"<<"}:
                line = key.start_mark.line + 1
                raise ValueError(f"key {key.value!r} stands twice, see line {line}")
            seen |= {key.value} if isinstance(key.value, str) else set()
        return super().construct_mapping(node, deep)


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
