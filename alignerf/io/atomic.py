"""Atomic outputs: written under a temporary name beside their path, then renamed.

A temporary name tells its machine and its process, so that the next run can remove
what a killed process has left behind.
"""

import contextlib
import errno
import functools
import os
import platform
import re
import shutil
import tempfile
from pathlib import Path

from alignerf.io import owned

# Errors of writing that do not say which file.
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
# NumPy's text of a short write; it passes on no reason.
SHORT = re.compile(r"\d+ requested and \d+ written")


@contextlib.contextmanager
def replace_file(path):
    """Yield a temporary path beside `path` that takes its place on success.

    The temporary name keeps the suffix, which writers choose their format by.
    """
    path = Path(path)
    owned.check_links(path)
    with naming(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        prefix = temporary_prefix(path.stem)
        handle, name = tempfile.mkstemp(
            dir=path.parent, prefix=prefix, suffix=path.suffix
        )
        os.close(handle)
    temporary = Path(name)
    try:
        with naming(path):
            yield temporary
            os.chmod(temporary, 0o666 & ~_UMASK)
            os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


@contextlib.contextmanager
def replace_folder(path):
    """Yield a temporary folder beside `path` that takes its place on success.

    Of one that is there a user's files stay. ValueError where all are a user's.
    """
    path = Path(path)
    owned.check(path)
    # It makes the folder that this one is to lie in, and takes it away again.
    with naming(path), scratch_folder(path.parent, name=path.name) as scratch:
        fresh = scratch / "new"
        fresh.mkdir()
        yield fresh
        move(fresh, path)


def move(source, target):
    """Rename a whole file or folder onto `target`, on the same file system.

    A folder gets its mark. Raises ValueError as `owned.check` and `owned.merge`.
    """
    if Path(source).is_dir():
        owned.check(target)
        owned.seal(source)
        if owned.others(target):
            return owned.merge(source, target)
        # A folder cannot be renamed onto a full one: the old one steps aside first.
        with scratch_folder(Path(target).parent, name="old") as scratch:
            with contextlib.suppress(FileNotFoundError):
                os.rename(target, scratch / "old")
            os.rename(source, target)
    else:
        owned.check_links(target)
        os.replace(source, target)


@contextlib.contextmanager
def scratch_folder(parent, *, name="scratch"):
    """Yield a folder inside `parent` that is gone afterwards, whatever happens.

    A `parent` that did not exist and is still empty goes with it, so that a failed
    stage leaves nothing behind.
    """
    parent = Path(parent)
    owned.check_links(parent)
    existed = parent.exists()
    # Of a folder that is about to be replaced, errors name that.
    target = parent if name == "scratch" else parent / name
    with naming(target):
        parent.mkdir(parents=True, exist_ok=True)
        prefix = temporary_prefix(name)
        scratch = Path(tempfile.mkdtemp(dir=parent, prefix=prefix))
    try:
        with naming(target):
            yield scratch
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
        if not existed:
            with contextlib.suppress(OSError):
                parent.rmdir()


def temporary_prefix(name):
    """Prefix of a temporary name of this process, cut to the length a file may have."""
    name = name.encode(errors="ignore")[:60].decode(errors="ignore")
    return f".{name}.~{machine()}~{os.getpid()}~"


@functools.cache
def machine():
    """Name of this machine and of its namespace of process ids, as of a container."""
    try:
        room = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        room = 0
    return f"{platform.node().replace('~', '')[:60]}-{room}"


@contextlib.contextmanager
def naming(path):
    """Add the path to an error of a full disk inside, which names no file."""
    try:
        yield
    except OSError as error:
        if SHORT.fullmatch(str(error)):
            error.errno, error.strerror = errno.ENOSPC, os.strerror(errno.ENOSPC)
        if error.errno in NO_ROOM and error.filename is None:
            error.filename = str(path)
        raise


def sweep(folder, *, below=True):
    """Remove what dead processes of this machine have left in a folder, and below.

    Returns the removed paths. Files of living processes and of other machines stay.
    """
    removed = []
    for parent, folders, files in os.walk(folder):
        for name in [*folders, *files]:
            if is_left_behind(name):
                path = Path(parent, name)
                if name in folders:
                    folders.remove(name)
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    with contextlib.suppress(OSError):
                        path.unlink()
                removed.append(path)
        if not below:
            break
    return removed


def is_left_behind(name):
    """Whether a name is that of a temporary file whose process is no more."""
    owner = owned.TEMPORARY.match(name)
    if not owner or owner["host"] != machine():
        return False
    try:
        os.kill(int(owner["process"]), 0)
    except ProcessLookupError:
        return True
    # Another user's process lives; a number too large belongs to none.
    except OverflowError:
        return True
    except OSError:
        return False
    return False


def _umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


# Read once: it is read by setting it, which other threads must not see.
_UMASK = _umask()
