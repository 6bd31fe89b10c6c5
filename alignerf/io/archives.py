"""Reading .npz and .npy: whatever is wrong with one is a ValueError that names it.

The head of an array says how large it is: it is looked at before any of its values.
"""

import contextlib
import math
import zipfile
from pathlib import Path

import numpy as np

from alignerf.io import faults

# Of one array: a flow of 16384 x 16384 pixels, the largest photo there may be.
MAX_BYTES = 2**31
MAX_HEAD_BYTES = 10_000
# Of a map that another program has written: 8192 x 8192 pixels.
MAX_VALUES = 2**26


def read(path, names):
    """{name: array} of these arrays of an .npz; never unpickles.

    Raises ValueError where the file is missing, no whole .npz, or lacks one, and where
    one is too large.
    """
    with _opened(path, names) as archive:
        return {name: read_member(archive, name) for name in names}


def has(path, name):
    """Whether an .npz has an array of this name; ValueError as of `read`."""
    with _opened(path, ()) as archive:
        return f"{name}.npy" in archive.namelist()


@contextlib.contextmanager
def _opened(path, names):
    """Open an .npz with arrays of these names; its faults are ValueErrors naming it."""
    with _file(path, ".npz") as file, zipfile.ZipFile(file) as archive:
        inside = set(archive.namelist())
        if missing := sorted(n for n in names if f"{n}.npy" not in inside):
            raise ValueError(f"no array {', '.join(missing)} in it")
        yield archive


@contextlib.contextmanager
def _file(path, kind):
    """Open a file of this kind; whatever is wrong with it is a ValueError naming it."""
    try:
        with faults.opened(path) as file:
            yield file
    # Decoders of damaged data raise a dozen types, and each means the same to the user.
    except Exception as error:
        # Errors of the system name the file, those of decoders do not.
        if isinstance(error, faults.Named) or getattr(error, "filename", None):
            raise
        fault = f"{path}: not the {kind} that it should be"
        raise ValueError(f"{fault}: {error}") from None


def read_member(archive, name):
    """An array of an open archive, its size by its head looked at before its values."""
    info = archive.getinfo(f"{name}.npy")
    with archive.open(info) as member:
        shape, dtype, head_bytes = read_head(member)
    check_size(shape, dtype, info.file_size - head_bytes)
    with archive.open(info) as member:
        return np.lib.format.read_array(member, allow_pickle=False)


def read_head(file):
    """(shape, dtype, its own bytes) of an .npy whose values come next."""
    version = np.lib.format.read_magic(file)
    heads = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }
    if version not in heads:
        raise ValueError(f"version {version} of its format")
    # NumPy reads all of a head before it looks how long that is.
    begins, size = file.tell(), 2 * version[0]
    if (length := int.from_bytes(file.read(size), "little")) > MAX_HEAD_BYTES:
        raise ValueError(f"a head of {length:,} bytes")
    file.seek(begins)
    shape, _, dtype = heads[version](file)
    if dtype.hasobject:
        raise ValueError("objects, which nothing here unpickles")
    if min(shape, default=0) < 0:
        raise ValueError(f"a shape of {shape}")
    return shape, dtype, file.tell()


def check_size(shape, dtype, held_bytes):
    """ValueError where an array is too large, or cut short."""
    size = math.prod(shape) * dtype.itemsize
    if size > MAX_BYTES:
        raise ValueError(f"{size / 2**30:.3g} GiB are more than {MAX_BYTES / 2**30:g}")
    if size != held_bytes:
        raise ValueError(f"{held_bytes} bytes instead of {size}")


def read_numbers(path):
    """The numbers of an .npy or an .npz: of that `depth`, or its only ones.

    Raises ValueError as `read` does, and, by the head alone, for over MAX_VALUES.
    """
    kind = Path(path).suffix.lower()
    with contextlib.ExitStack() as stack:
        file = stack.enter_context(_file(path, f"{kind} of numbers"))
        if kind == ".npz":
            archive = stack.enter_context(zipfile.ZipFile(file))
            names = archive.namelist()
            if "depth.npy" not in names and len(names) != 1:
                few = faults.some_names(names)
                raise ValueError(f"no array depth among {len(names)}: {few}")
            name = names[0] if len(names) == 1 else "depth.npy"
            file = stack.enter_context(archive.open(name))
        shape, dtype, _ = read_head(file)
        if dtype.kind not in "fiu":
            raise ValueError(f"{dtype} instead of real numbers")
        if math.prod(shape) > MAX_VALUES:
            raise ValueError(f"{list(shape)} are over {MAX_VALUES:,} values")
        file.seek(0)
        values = np.lib.format.read_array(file, allow_pickle=False)
        if file.read(1):
            raise ValueError("more bytes than its head says")
        return values
