"""Outputs that are whole or not there: written beside their place, then renamed."""

import contextlib
import os
import shutil
import tempfile
from pathlib import Path


@contextlib.contextmanager
def replace_file(path):
    """Yield a temporary path beside `path` that takes its place on success.

    The temporary name keeps the suffix, which writers choose their format by.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(
        dir=path.parent, prefix=f".{path.stem}.", suffix=path.suffix
    )
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        os.chmod(temporary, 0o666 & ~_UMASK)
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def replace_folder(path):
    """Yield a temporary folder beside `path` that takes its place on success."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with scratch_folder(path.parent, prefix=f".{path.name}.") as scratch:
        fresh = scratch / "new"
        fresh.mkdir()
        yield fresh
        move(fresh, path)


def move(source, target):
    """Rename a whole file or folder onto `target`, on the same file system."""
    if Path(source).is_dir():
        # A folder cannot be renamed onto a full one: the old one steps aside first.
        with scratch_folder(Path(target).parent, prefix=".old.") as scratch:
            with contextlib.suppress(FileNotFoundError):
                os.rename(target, scratch / "old")
            os.rename(source, target)
    else:
        os.replace(source, target)


@contextlib.contextmanager
def scratch_folder(parent, *, prefix=".scratch."):
    """Yield a folder inside `parent` that is gone afterwards, whatever happens.

    A `parent` that did not exist and is still empty goes with it, so that a failed
    stage leaves nothing behind.
    """
    parent = Path(parent)
    existed = parent.exists()
    parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(dir=parent, prefix=prefix))
    try:
        yield scratch
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
        if not existed:
            with contextlib.suppress(OSError):
                parent.rmdir()


def _umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


# Read once: it is read by setting it, which other threads must not see.
_UMASK = _umask()
