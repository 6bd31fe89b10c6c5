"""Tensors of a PyTorch state dict, read without PyTorch.

Two formats, both little-endian: the legacy one of torch.save (until 1.5: five pickles,
then each storage as an int64 count and its numbers) and the zip archive since
(`<root>/data.pkl` and `<root>/data/<key>`). Of the storages only those that are asked
for are read; whoever calls knows the file's SHA-256. A pickle imports nothing: the few
names of a state dict stand for inert classes here, and any other name is refused.
"""

import pickle
import zipfile
from typing import NamedTuple

import numpy as np

from alignerf.io import faults

MAGIC = 0x1950A86A20F9469CFC6C
# Storage classes of `torch`, and the numbers that they hold.
DTYPES = {"FloatStorage": "<f4", "DoubleStorage": "<f8"}
DTYPES |= {"HalfStorage": "<f2", "LongStorage": "<i8"}


class Storage(NamedTuple):
    """`count` numbers of a dtype, stored elsewhere in the file under `key`."""

    dtype: str
    key: str
    count: int


# Each of these has a __setstate__, since without one a pickle sets attributes.
class State(dict):
    """A dict of tensors."""

    def __setstate__(self, state):
        """Versions of the modules are not needed."""


class Tensor:
    """A strided view of a storage; offset and strides count numbers."""

    def __init__(self, storage, offset, shape, strides, *_):
        self.storage, self.offset = storage, offset
        self.shape, self.strides = shape, strides

    def __setstate__(self, state):
        """Hooks and flags are not needed."""


class Parameter:
    """A tensor in the wrapping that state dicts of 2017 still have."""

    # A pickle may make one without its __init__.
    def __new__(cls, data=None, *_):
        parameter = object.__new__(cls)
        parameter.data = data
        return parameter

    def __setstate__(self, state):
        if len(state) == 5:
            self.data = state[0]


CLASSES = {
    ("collections", "OrderedDict"): State,
    ("torch._utils", "_rebuild_tensor"): Tensor,
    ("torch._utils", "_rebuild_tensor_v2"): Tensor,
    ("torch._utils", "_rebuild_parameter"): Parameter,
    ("torch.nn.parameter", "Parameter"): Parameter,
    **{("torch", name): dtype for name, dtype in DTYPES.items()},
}


class Unpickler(pickle.Unpickler):
    """Unpickles State, Tensor, Parameter and plain values, and nothing else."""

    def find_class(self, module, name):
        if (module, name) not in CLASSES:
            raise ValueError(f"global {module} {name} is not one of a state dict")
        return CLASSES[module, name]

    def persistent_load(self, pid):
        """pid: ('storage', class, key, device, count[, view])."""
        _, dtype, key, _, count, *_ = pid
        return Storage(dtype, key, count)


def unpickle(file):
    """The object of the pickle at the file's position, which then stands behind it."""
    return Unpickler(file, encoding="latin1").load()


def read(path, shapes):
    """{name: float32 array} of the tensors in `shapes` {name: shape}.

    Raises ValueError, naming the file, where it is no state dict, cut short, or
    lacks one of them in this shape and finite.
    """
    try:
        with faults.opened(path) as file:
            if zipfile.is_zipfile(file):
                with zipfile.ZipFile(file) as archive:
                    return _read_zip(archive, shapes)
            return _read_legacy(file, shapes)
    except faults.Named:
        raise
    # Decoders of damaged data raise a dozen types, and each means the same to the user.
    except Exception as error:
        raise ValueError(f"{path}: no state dict that fits: {error}") from None


def _read_legacy(file, shapes):
    file.seek(0)
    if unpickle(file) != MAGIC:
        raise ValueError("not a file of torch.save")
    for _ in ("protocol", "system"):
        unpickle(file)
    tensors, keys = _tensors(unpickle(file)), unpickle(file)
    storages = {tensor.storage.key: tensor.storage for tensor in tensors.values()}
    starts, position = {}, file.tell()
    for key in keys:
        # A storage's numbers stand behind their count, in the order of the keys.
        starts[key] = position + 8
        position = starts[key] + _bytes_of(storages[key])

    def numbers(storage):
        file.seek(starts[storage.key])
        return file.read(_bytes_of(storage))

    return {
        name: _array(name, tensors, shape, numbers) for name, shape in shapes.items()
    }


def _read_zip(archive, shapes):
    head = next(name for name in archive.namelist() if name.endswith("/data.pkl"))
    with archive.open(head) as file:
        tensors = _tensors(unpickle(file))

    def numbers(storage):
        return archive.read(f"{head.removesuffix('.pkl')}/{storage.key}")

    return {
        name: _array(name, tensors, shape, numbers) for name, shape in shapes.items()
    }


def _tensors(state):
    """{name: Tensor} of a state dict."""
    inner = {name: getattr(value, "data", value) for name, value in state.items()}
    return {k: v for k, v in inner.items() if isinstance(v, Tensor)}


def _array(name, tensors, shape, numbers):
    """A tensor of this shape as an array; `numbers` gives a storage's bytes."""
    if name not in tensors:
        raise ValueError(f"no tensor {name} in it")
    tensor = tensors[name]
    if tensor.shape != tuple(shape):
        raise ValueError(f"tensor {name} is {tensor.shape} instead of {shape}")
    # Of a view beyond its storage NumPy says so.
    dtype = np.dtype(tensor.storage.dtype)
    array = np.ndarray(
        shape,
        dtype,
        numbers(tensor.storage),
        tensor.offset * dtype.itemsize,
        [step * dtype.itemsize for step in tensor.strides],
    ).astype(np.float32)
    if not np.isfinite(array).all():
        raise ValueError(f"tensor {name} is not finite")
    return array


def _bytes_of(storage):
    return storage.count * np.dtype(storage.dtype).itemsize
