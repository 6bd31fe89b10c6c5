"""The pickle inside a PyTorch state dict, interpreted and never executed.

Only the opcodes and globals that torch.save writes for a dict of tensors have a
meaning here, and that meaning is an inert record: nothing is imported, called or
built by a name in the file. Anything else is refused by name.
"""

import dataclasses
import pickletools
import re
import warnings
from typing import NamedTuple

# Storage classes and the little-endian numbers that they hold.
STORAGES = {
    "torch FloatStorage": "<f4",
    "torch DoubleStorage": "<f8",
    "torch HalfStorage": "<f2",
    "torch LongStorage": "<i8",
}


# A convolution's kernel has four.
MOST_AXES = 8


class Global(NamedTuple):
    """A name that the pickle refers to, as `module name`."""

    name: str


class Storage(NamedTuple):
    """`count` numbers of a dtype, stored elsewhere in the file under `key`."""

    dtype: str
    key: str
    count: int


class Tensor(NamedTuple):
    """A strided view of a storage; offset and strides count numbers."""

    storage: Storage
    offset: int
    shape: tuple
    strides: tuple


@dataclasses.dataclass
class Parameter:
    """A tensor in the wrapping that state dicts of 2017 still have."""

    data: Tensor | None = None


def interpret(stream):
    """The object of the pickle that starts at the stream's position.

    Made of str, int, bool, None, tuple, list, dict with str keys, and the records
    above. The stream stands behind the pickle afterwards. Raises ValueError.
    """
    machine = _Machine()
    try:
        with warnings.catch_warnings():
            # pickletools warns of an escape in a name that Python does not know.
            warnings.simplefilter("error")
            _run(machine, stream)
    except (IndexError, KeyError, TypeError, Warning) as error:
        raise ValueError(f"broken pickle: {type(error).__name__}") from None
    if machine.frames or len(machine.stack) != 1:
        raise ValueError("broken pickle: it does not end in one object")
    return machine.stack[0]


def _run(machine, stream):
    for opcode, argument, _ in pickletools.genops(stream):
        if opcode.name == "STOP":
            return
        if opcode.name not in _ACTIONS:
            raise ValueError(f"opcode {opcode.name} is not one of a state dict")
        _ACTIONS[opcode.name](machine, argument)


class _Machine:
    """Stack, marked stacks below it, and memo, as in the pickle protocol."""

    def __init__(self):
        self.stack, self.frames, self.memo = [], [], {}

    def push(self, value):
        self.stack.append(value)

    def mark(self):
        self.frames.append(self.stack)
        self.stack = []

    def pop_marked(self):
        marked, self.stack = self.stack, self.frames.pop()
        return marked

    def pop(self, count):
        """The `count` topmost values, the last one on top."""
        if count > len(self.stack):
            raise ValueError("broken pickle: its stack is empty")
        start = len(self.stack) - count
        values = self.stack[start:]
        del self.stack[start:]
        return values

    def append(self, values):
        _typed(self.stack[-1], list).extend(values)

    def set_items(self, values):
        pairs = zip(values[::2], values[1::2], strict=True)
        _typed(self.stack[-1], dict).update(_dict_of(pairs))

    def call(self):
        function, arguments = self.pop(2)
        name = _typed(function, Global).name
        if name not in _CALLS:
            raise ValueError(f"global {name} is not a function of a state dict")
        self.push(_CALLS[name](*_typed(arguments, tuple)))

    def build(self):
        # Hooks, versions and flags of a tensor, a parameter or the dict: not needed.
        (state,) = self.pop(1)
        target = self.stack[-1]
        if isinstance(target, Parameter) and len(_typed(state, tuple)) == 5:
            target.data = _typed(state[0], Tensor)


def _typed(value, kind):
    if not isinstance(value, kind):
        own = type(value).__name__
        raise ValueError(f"broken pickle: {own} in place of {kind.__name__}")
    return value


def _dict_of(pairs):
    # Only text: the hash of a deeply nested tuple would overflow the C stack.
    return {_typed(key, str): value for key, value in pairs}


def _global(name):
    if name not in STORAGES and name not in _CALLS:
        raise ValueError(f"global {name} is not one of a state dict")
    return Global(name)


def _storage(identity):
    """A persistent id: ('storage', class, key, device, count[, view])."""
    kind, storage, key, _, count, *view = _typed(identity, tuple)
    if kind != "storage" or view not in ([], [None]):
        raise ValueError("a persistent id that is no whole storage")
    name = _typed(storage, Global).name
    if name not in STORAGES or not re.fullmatch("[0-9]{1,20}", _typed(key, str)):
        raise ValueError(f"no storage: {name}")
    return Storage(STORAGES[name], key, _count(count))


def _tensor(storage, offset, shape, strides, *_):
    if len(_typed(shape, tuple)) > MOST_AXES:
        raise ValueError(f"a tensor of {len(shape)} axes")
    shape = tuple(_count(n) for n in shape)
    if len(_typed(strides, tuple)) != len(shape):
        raise ValueError(f"{len(strides)} strides of {len(shape)} axes")
    strides = tuple(_count(n) for n in strides)
    return Tensor(_typed(storage, Storage), _count(offset), shape, strides)


def _count(value):
    if not 0 <= _typed(value, int) < 2**63:
        raise ValueError("a size, stride or offset out of range")
    return value


_CALLS = {
    "collections OrderedDict": lambda pairs=(): _dict_of(pairs),
    "torch._utils _rebuild_tensor": _tensor,
    "torch._utils _rebuild_tensor_v2": _tensor,
    "torch._utils _rebuild_parameter": lambda tensor, *_: Parameter(tensor),
    "torch.nn.parameter Parameter": Parameter,
}
_LITERALS = (
    *("BININT", "BININT1", "BININT2", "LONG1"),
    *("BINUNICODE", "BINSTRING", "SHORT_BINSTRING"),
)
_ACTIONS = {
    "PROTO": lambda m, _: None,
    **dict.fromkeys(_LITERALS, _Machine.push),
    "NONE": lambda m, _: m.push(None),
    "NEWTRUE": lambda m, _: m.push(True),
    "NEWFALSE": lambda m, _: m.push(False),
    "EMPTY_TUPLE": lambda m, _: m.push(()),
    "EMPTY_LIST": lambda m, _: m.push([]),
    "EMPTY_DICT": lambda m, _: m.push({}),
    "MARK": lambda m, _: m.mark(),
    "TUPLE": lambda m, _: m.push(tuple(m.pop_marked())),
    "TUPLE1": lambda m, _: m.push(tuple(m.pop(1))),
    "TUPLE2": lambda m, _: m.push(tuple(m.pop(2))),
    "TUPLE3": lambda m, _: m.push(tuple(m.pop(3))),
    "APPEND": lambda m, _: m.append(m.pop(1)),
    "APPENDS": lambda m, _: m.append(m.pop_marked()),
    "SETITEM": lambda m, _: m.set_items(m.pop(2)),
    "SETITEMS": lambda m, _: m.set_items(m.pop_marked()),
    **dict.fromkeys(
        ("BINPUT", "LONG_BINPUT"), lambda m, key: m.memo.update({key: m.stack[-1]})
    ),
    **dict.fromkeys(("BINGET", "LONG_BINGET"), lambda m, key: m.push(m.memo[key])),
    "GLOBAL": lambda m, name: m.push(_global(name)),
    "REDUCE": lambda m, _: m.call(),
    "NEWOBJ": lambda m, _: m.call(),
    "BUILD": lambda m, _: m.build(),
    "BINPERSID": lambda m, _: m.push(_storage(m.pop(1)[0])),
}
