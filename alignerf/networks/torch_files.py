"""Tensors of a PyTorch state dict, read without PyTorch.

Two formats, both little-endian here: the legacy one of torch.save (until 1.5: five
pickles, then each storage as an int64 count and its numbers) and the zip archive
since (`<root>/data.pkl` and `<root>/data/<key>`). Of the storages only those that
are asked for are read. A pickle imports nothing: the few names of a state dict stand
for inert classes of this module, and any other name or opcode is refused.
"""

import io
import math
import os
import pickle
import pickletools
import re
import warnings
import zipfile
from typing import NamedTuple

import numpy as np

from alignerf.files import faults

MAGIC = 0x1950A86A20F9469CFC6C
PROTOCOL = 1001
# Of a file's pickles together, storages apart; SqueezeNet's take 10 KB. Nested tuples
# as deep as that still have a hash.
MOST_PICKLE_BYTES = 1 << 15
# A convolution's kernel has four.
MOST_AXES = 8
# Storage classes of `torch`, and the numbers that they hold.
DTYPES = {"FloatStorage": "<f4", "DoubleStorage": "<f8"}
DTYPES |= {"HalfStorage": "<f2", "LongStorage": "<i8"}
# What torch.save writes for a dict of tensors. Others declare sizes of their own, or
# look names up elsewhere than by `find_class`.
OPCODES = re.compile(
    r"PROTO|STOP|MARK|NONE|NEWTRUE|NEWFALSE|BININT[12]?|LONG1|BINUNICODE"
    r"|(SHORT_)?BINSTRING|(EMPTY_)?TUPLE|TUPLE[123]|EMPTY_LIST|APPENDS?|EMPTY_DICT"
    r"|SETITEMS?|(LONG_)?BIN(PUT|GET)|GLOBAL|REDUCE|NEWOBJ|BUILD|BINPERSID"
)


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

    def __new__(cls, storage, offset, shape, strides, *_):
        if not (isinstance(storage, Storage) and type(shape) is type(strides) is tuple):
            raise ValueError("a tensor without storage, shape or strides")
        if len(strides) != len(shape) or len(shape) > MOST_AXES:
            raise ValueError(f"{len(strides)} strides of {len(shape)} axes")
        for number in (storage.count, offset, *shape, *strides):
            if type(number) is not int or not 0 <= number < 2**63:
                raise ValueError("a size, stride or offset out of range")
        tensor = object.__new__(cls)
        tensor.storage, tensor.offset = storage, offset
        tensor.shape, tensor.strides = shape, strides
        return tensor

    def __setstate__(self, state):
        """Hooks and flags are not needed."""


class Parameter:
    """A tensor in the wrapping that state dicts of 2017 still have."""

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
        kind, dtype, key, _, count, *view = pid
        if (
            kind != "storage"
            or dtype not in DTYPES.values()
            or view not in ([], [None])
        ):
            raise ValueError("no storage, or a part of one")
        if not re.fullmatch("[0-9]{1,20}", key):
            raise ValueError("no storage: its key is no number")
        return Storage(dtype, key, count)


def unpickle(stream):
    """The object of the pickle at the stream's position, which then stands behind it.

    Opcodes are looked at first: a pickle may declare any size.
    """
    begins = stream.tell()
    with warnings.catch_warnings():
        # Of an escape in a name that Python does not know.
        warnings.simplefilter("ignore")
        for opcode, argument, _ in pickletools.genops(stream):
            if not OPCODES.fullmatch(opcode.name):
                raise ValueError(f"opcode {opcode.name} is not one of a state dict")
            if opcode.name == "LONG_BINPUT" and argument > MOST_PICKLE_BYTES:
                raise ValueError("a memo of more than the pickle's bytes")
    end = stream.tell()
    stream.seek(begins)
    return Unpickler(io.BytesIO(stream.read(end - begins)), encoding="latin1").load()


def read(path, shapes):
    """{name: float32 array} of the tensors in `shapes` {name: shape}.

    Raises ValueError, naming the file, where it is no state dict, cut short, or
    lacks one of them in this shape and finite.
    """
    try:
        with faults.opened(path) as file:
            if file.read(4) == b"PK\x03\x04":
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
    head = io.BytesIO(file.read(MOST_PICKLE_BYTES))
    if unpickle(head) != MAGIC or unpickle(head) != PROTOCOL:
        raise ValueError("not a file of torch.save")
    if unpickle(head).get("little_endian") is not True:
        raise ValueError("not written by a little-endian machine")
    tensors = _tensors(unpickle(head))
    starts = _legacy_starts(file, unpickle(head), head.tell(), tensors)

    def numbers(storage):
        file.seek(starts[storage.key])
        return file.read(_bytes_of(storage))

    return _arrays(tensors, shapes, numbers)


def _legacy_starts(file, keys, position, tensors):
    """{key: byte at which the numbers start}; storages follow in the order of keys."""
    storages = {tensor.storage.key: tensor.storage for tensor in tensors.values()}
    if not isinstance(keys, list) or sorted(keys) != sorted(storages):
        raise ValueError("its storages are not those of its tensors")
    end = file.seek(0, os.SEEK_END)
    starts = {}
    for key in keys:
        file.seek(position)
        if int.from_bytes(file.read(8), "little") != storages[key].count:
            raise ValueError(f"storage {key} is not as long as its tensor says")
        starts[key] = position + 8
        position = starts[key] + _bytes_of(storages[key])
        if position > end:
            raise ValueError("cut short")
    return starts


def _read_zip(archive, shapes):
    pickles = [name for name in archive.namelist() if name.endswith("/data.pkl")]
    if len(pickles) != 1:
        raise ValueError("not an archive of torch.save")
    root = pickles[0].removesuffix("data.pkl")
    order = f"{root}byteorder"
    if order in archive.namelist() and _member(archive, order, 6) != b"little":
        raise ValueError("not written by a little-endian machine")
    head = io.BytesIO(_member(archive, pickles[0], MOST_PICKLE_BYTES))

    def numbers(storage):
        return _member(archive, f"{root}data/{storage.key}", _bytes_of(storage))

    return _arrays(_tensors(unpickle(head)), shapes, numbers)


def _member(archive, name, most_bytes):
    """Content of a member: stored as it is, as torch.save does, never inflated."""
    info = archive.getinfo(name)
    if info.compress_type != zipfile.ZIP_STORED or info.flag_bits & 1:
        raise ValueError(f"{name} is compressed or encrypted")
    if info.file_size > most_bytes:
        raise ValueError(f"{name} is larger than it should be")
    return archive.read(info)


def _tensors(state):
    """{name: Tensor} of a state dict; other entries are left out."""
    if not isinstance(state, dict):
        raise ValueError("it holds no dict of tensors")
    inner = {
        name: value.data if isinstance(value, Parameter) else value
        for name, value in state.items()
    }
    return {k: v for k, v in inner.items() if isinstance(v, Tensor)}


def _arrays(tensors, shapes, numbers):
    """The tensors in `shapes` as arrays; `numbers` gives a storage's bytes."""
    arrays = {}
    for name, shape in shapes.items():
        if name not in tensors:
            raise ValueError(f"no tensor {name} in it")
        if tensors[name].shape != tuple(shape):
            own = tensors[name].shape
            raise ValueError(f"tensor {name} is {own} instead of {shape}")
        arrays[name] = _array(name, tensors[name], numbers)
    return arrays


def _array(name, tensor, numbers):
    storage, offset, shape = tensor.storage, tensor.offset, tensor.shape
    steps = [(n - 1) * s for n, s in zip(shape, tensor.strides, strict=True)]
    # A stride of 0 could make much of little; a state dict's tensors have none.
    if not 0 < math.prod(shape) <= storage.count - offset > sum(steps):
        raise ValueError(f"tensor {name} reaches beyond its storage")
    stored = numbers(storage)
    if len(stored) != _bytes_of(storage):
        raise ValueError(f"tensor {name} is cut short")
    flat = np.frombuffer(stored, storage.dtype)[offset:]
    strides = [s * flat.itemsize for s in tensor.strides]
    view = np.lib.stride_tricks.as_strided(flat, shape, strides, writeable=False)
    array = np.array(view, np.float32)
    if not np.isfinite(array).all():
        raise ValueError(f"tensor {name} is not finite")
    return array


def _bytes_of(storage):
    return storage.count * np.dtype(storage.dtype).itemsize
