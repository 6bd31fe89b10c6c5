"""Paths with `{split}` in them: one command line names the files of several splits.

A path of None stays None.
"""

from pathlib import Path

MARK = "{split}"


def check(splits, paths):
    """Raise ValueError where several splits would share a path."""
    for path in filter(None, paths):
        if len(splits) > 1 and MARK not in str(path):
            raise ValueError(f"{path}: {MARK} must be in it, for {', '.join(splits)}")


def fill(path, split):
    """The path with a split's name in place of MARK."""
    return path and Path(str(path).replace(MARK, split))
