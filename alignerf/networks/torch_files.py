"""Tensors of a PyTorch state dict, read without PyTorch and without unpickling.

Two formats, both little-endian here: the legacy one of torch.save (until 1.5: five
pickles, then each storage as an int64 count and its numbers) and the zip archive
since (`<root>/data.pkl` and `<root>/data/<key>`). Of the storages only those that
are asked for are read.
"""

import io
import math
import os
import zipfile

import numpy as np

from alignerf.files import faults
from alignerf.networks import state_dict_pickle as pickled

MAGIC = 0x1950A86A20F9469CFC6C
PROTOCOL = 1001
# Of a file's pickles together, storages apart; SqueezeNet's take 10 KB.
MOST_PICKLE_BYTES = 1 << 16


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
    if pickled.interpret(head) != MAGIC or pickled.interpret(head) != PROTOCOL:
        raise ValueError("not a file of torch.save")
    system = pickled.interpret(head)
    if not isinstance(system, dict) or system.get("little_endian") is not True:
        raise ValueError("not written by a little-endian machine")
    tensors = _tensors(pickled.interpret(head))
    starts = _legacy_starts(file, pickled.interpret(head), head.tell(), tensors)

    def numbers(storage):
        file.seek(starts[storage.key])
        return file.read(_bytes_of(storage))

    return _arrays(tensors, shapes, numbers)


def _legacy_starts(file, keys, position, tensors):
    """{key: byte at which the numbers start}; storages follow in the order of keys."""
    used = {tensor.storage for tensor in tensors.values()}
    storages = {storage.key: storage for storage in used}
    whole = isinstance(keys, list) and all(isinstance(key, str) for key in keys)
    if not whole or sorted(keys) != sorted(storage.key for storage in used):
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
    if f"{root}byteorder" in archive.namelist():
        order = _member(archive, f"{root}byteorder", len(b"little"))
        if order != b"little":
            raise ValueError("not written by a little-endian machine")
    head = io.BytesIO(_member(archive, pickles[0], MOST_PICKLE_BYTES))
    tensors = _tensors(pickled.interpret(head))

    def numbers(storage):
        name = f"{root}data/{storage.key}"
        return _member(archive, name, _bytes_of(storage))

    return _arrays(tensors, shapes, numbers)


def _member(archive, name, most_bytes):
    """Content of a member: stored as it is, as torch.save does, never inflated."""
    if name not in archive.namelist():
        raise ValueError(f"no {name} in it")
    info = archive.getinfo(name)
    if info.compress_type != zipfile.ZIP_STORED or info.flag_bits & 1:
        raise ValueError(f"{name} is compressed or encrypted")
    if info.file_size > most_bytes:
        raise ValueError(f"{name} is larger than it should be")
    return archive.read(info)


def _tensors(state):
    """{name: Tensor} of an interpreted state dict; other entries are left out."""
    if not isinstance(state, dict):
        raise ValueError("it holds no dict of tensors")
    inner = {
        name: value.data if isinstance(value, pickled.Parameter) else value
        for name, value in state.items()
    }
    return {k: v for k, v in inner.items() if isinstance(v, pickled.Tensor)}


def _arrays(tensors, shapes, numbers):
    """The tensors in `shapes` as arrays; `numbers` gives a storage's bytes."""
    arrays = {}
    for name, shape in shapes.items():
        if name not in tensors:
            raise ValueError(f"no tensor {name} in it")
        tensor = tensors[name]
        if tensor.shape != tuple(shape):
            raise ValueError(f"tensor {name} is {tensor.shape} instead of {shape}")
        arrays[name] = _array(name, tensor, numbers)
    return arrays


def _array(name, tensor, numbers):
    storage, offset, shape, strides = tensor
    steps = [(n - 1) * s for n, s in zip(shape, strides, strict=True)]
    # A stride of 0 could make much of little; a state dict's tensors have none.
    if not 0 < math.prod(shape) <= storage.count - offset > sum(steps):
        raise ValueError(f"tensor {name} reaches beyond its storage")
    stored = numbers(storage)
    if len(stored) != _bytes_of(storage):
        raise ValueError(f"tensor {name} is cut short")
    flat = np.frombuffer(stored, storage.dtype)[offset:]
    strides = [s * flat.itemsize for s in strides]
    view = np.lib.stride_tricks.as_strided(flat, shape, strides, writeable=False)
    array = np.array(view, np.float32)
    if not np.isfinite(array).all():
        raise ValueError(f"tensor {name} is not finite")
    return array


def _bytes_of(storage):
    return storage.count * np.dtype(storage.dtype).itemsize
