"""How a fault is told, and what several checks ask."""

from pathlib import Path

from alignerf.experiment import kinds


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


def is_derived(method):
    """Whether a method is no training from scratch that others may be set against."""
    return kinds.of_method(method) is not kinds.plain
