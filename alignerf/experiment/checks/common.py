"""How a fault is told, and what several checks ask."""

from pathlib import Path


def fault(where, what):
    raise ValueError(f"config: {where}: {what}")


def is_there(path, *, of_kind=Path.exists):
    """Whether a path exists; one that no file can have does not."""
    try:
        return of_kind(Path(path))
    except OSError:
        return False


def first(names):
    return next(iter(names))
