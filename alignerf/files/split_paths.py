"""Paths with `{split}` in them: one command line names the files of several splits.

A path of None stays None.
"""

import contextlib
from pathlib import Path

from alignerf.files import atomic, owned

MARK = "{split}"


def check(splits, paths):
    """Raise ValueError where several splits would share a path."""
    for path in filter(None, paths):
        if len(splits) > 1 and MARK not in str(path):
            raise ValueError(f"{path}: {MARK} must be in it, for {', '.join(splits)}")


def fill(path, split):
    """The path with a split's name in place of MARK."""
    return path and Path(str(path).replace(MARK, split))


@contextlib.contextmanager
def replace_file(path, split):
    """`atomic.replace_file` of a split's file; its folder's mark lists it before."""
    filled = fill(path, split)
    note(path, filled)
    with atomic.replace_file(filled) as temporary:
        yield temporary


def note(path, filled):
    """Put a file into the mark of its folder, where that holds a file of each split."""
    if MARK in Path(path).name:
        owned.put(filled.parent, [filled.name])
