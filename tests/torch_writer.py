"""Files as torch.save writes them, without PyTorch: both formats, and older ways."""

import collections
import io
import pickle
import sys
import types
import zipfile

import numpy as np

MAGIC = 0x1950A86A20F9469CFC6C
SYSTEM = {"protocol_version": 1001, "little_endian": True, "type_sizes": {"int": 4}}
STORAGES = {"<f4": "FloatStorage", "<f8": "DoubleStorage", "<i8": "LongStorage"}


class Tensor:
    """An array that pickles as PyTorch's tensors do."""

    def __init__(self, array, *, key, parameter=False):
        self.array, self.key, self.parameter = array, key, parameter

    def __reduce__(self):
        strides = tuple(s // self.array.itemsize for s in self.array.strides)
        storage = Storage(self.array, self.key)
        made = (storage, 0, self.array.shape, strides)
        rebuild = sys.modules["torch._utils"]._rebuild_tensor_v2
        if not self.parameter:
            return rebuild, (*made, False, collections.OrderedDict())
        inner = Tensor(self.array, key=self.key)
        rebuild = sys.modules["torch._utils"]._rebuild_parameter
        return rebuild, (inner, True, collections.OrderedDict())


class Storage:
    def __init__(self, array, key):
        self.array, self.key = array, key


class Pickler(pickle.Pickler):
    """Storages as persistent ids; the legacy ones end in the view's."""

    def __init__(self, file, *, legacy):
        super().__init__(file, protocol=2)
        self.rest = (None,) if legacy else ()

    def persistent_id(self, found):
        if not isinstance(found, Storage):
            return None
        kind = getattr(sys.modules["torch"], STORAGES[found.array.dtype.str])
        return ("storage", kind, found.key, "cpu", found.array.size, *self.rest)


def fake_torch(monkeypatch):
    """Modules with the names that a state dict refers to."""
    names = {
        "torch": list(STORAGES.values()),
        "torch._utils": ["_rebuild_tensor_v2", "_rebuild_parameter"],
    }
    for module, kinds in names.items():
        fake = types.ModuleType(module)
        for kind in kinds:
            setattr(fake, kind, type(kind, (), {"__module__": module}))
        monkeypatch.setitem(sys.modules, module, fake)


def state_dict(arrays, **options):
    """OrderedDict of tensors, each with a storage of its own, and its versions."""
    state = collections.OrderedDict(
        (name, Tensor(np.ascontiguousarray(array), key=str(9000 + i), **options))
        for i, (name, array) in enumerate(arrays.items())
    )
    state._metadata = collections.OrderedDict({"": {"version": 1}})
    return state


def pickled(value, *, legacy):
    file = io.BytesIO()
    Pickler(file, legacy=legacy).dump(value)
    return file.getvalue()


def head():
    """The three pickles that a legacy file starts with."""
    return b"".join(pickle.dumps(value, 2) for value in (MAGIC, 1001, SYSTEM))


def legacy(state):
    """The bytes of a legacy file; storages in an order of their own."""
    arrays = {t.key: t.array for t in state.values() if isinstance(t, Tensor)}
    keys = sorted(arrays, reverse=True)
    parts = [head(), pickled(state, legacy=True), pickle.dumps(keys, 2)]
    for key in keys:
        parts += [arrays[key].size.to_bytes(8, "little"), arrays[key].tobytes("A")]
    return b"".join(parts)


def zipped(state):
    """The bytes of a zip archive."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("net/data.pkl", pickled(state, legacy=False))
        archive.writestr("net/byteorder", b"little")
        for tensor in state.values():
            archive.writestr(f"net/data/{tensor.key}", tensor.array.tobytes("A"))
    return file.getvalue()


FORMATS = {"legacy": legacy, "zipped": zipped}

# As Python 2 wrote them: byte strings, the dict as a list of pairs; three ways in
# which a tensor stood in it, the later two as a module's parameter.
TENSOR = (
    b"ctorch._utils\n_rebuild_tensor\n((U\x07storagectorch\nFloatStorage\n"
    b"U\x0212U\x06cuda:0\x8a\x01\x07NtQK\x01(K\x02K\x03t(K\x03K\x01ttR"
)
PARAMETER = b"ctorch.nn.parameter\nParameter\n"
OLD_WAYS = {
    "tensor": TENSOR,
    "parameter": PARAMETER + TENSOR + b"\x85\x81q\x09(\x88\x89}tb",
    "variable": PARAMETER + b")\x81q\x09(" + TENSOR + b"N}\x88\x89tb",
}


def old(tensor=TENSOR):
    start = b"\x80\x02ccollections\nOrderedDict\nq\x01]q\x02(]q\x03(U\x01aq\x04"
    return start + tensor + b"ee\x85R}U\x09_metadata}sb."
