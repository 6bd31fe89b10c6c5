"""Reading .npz and .npy: whatever is wrong with one is a ValueError that names it."""

import tokenize
import zipfile
import zlib

import numpy as np

# What np.load raises on files that are no archive, cut short or altered.
_BROKEN = (
    ValueError,
    KeyError,
    TypeError,
    EOFError,
    NotImplementedError,
    OverflowError,
    MemoryError,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)


def read(path, names):
    """{name: array} of these arrays of an .npz; never unpickles.

    Raises ValueError where the file is missing, no whole .npz, or lacks one.
    """
    try:
        # Opened here, since np.load leaves its own handle open on broken archives.
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as stored:
            if missing := sorted(set(names) - set(stored)):
                raise ValueError(f"no array {', '.join(missing)} in it")
            return {name: stored[name] for name in names}
    except FileNotFoundError:
        raise ValueError(f"{path}: not found") from None
    except _BROKEN as error:
        raise ValueError(f"{path}: not the .npz that it should be: {error}") from None


def read_array(path):
    """The array of an .npy; never unpickles.

    Raises ValueError where the file is missing or no whole .npy of plain values.
    """
    try:
        with open(path, "rb") as file:
            return np.lib.format.read_array(file, allow_pickle=False)
    except FileNotFoundError:
        raise ValueError(f"{path}: not found") from None
    # A damaged header may ask for more values than there is memory.
    except (*_BROKEN, MemoryError) as error:
        raise ValueError(f"{path}: not the .npy that it should be: {error}") from None
