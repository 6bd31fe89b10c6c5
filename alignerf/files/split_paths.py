"""Paths of each split, where one command line names those of several.

A path that is not given, None, stays so.
"""

from pathlib import Path

MARK = "{split}"


def check(splits, paths):
    """Raise ValueError where several splits would share a path."""
    for path in filter(None, paths):
        if len(splits) > 1 and MARK not in str(path):
            raise ValueError(f"{path}: {MARK} must be in it, for {', '.join(splits)}")


def fill(path, split):
    """The path of a split: its name stands in it where MARK stood."""
    return path and Path(str(path).replace(MARK, split))
