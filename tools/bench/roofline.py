"""Where a step's time goes: seconds, memory and arithmetic of each part of the program.

The compiled step is listed operation by operation, with the arrays that each reads and
writes, and is run under JAX's profiler, which tells how long each took. A part's bytes
are counted as if no cache held anything: more of them a second than a copy of 64 MB
moves says that caches do. The limits, that copy and a large matrix product, are
measured beside. One core; of the demo's grid.
"""

import collections
import functools
import glob
import gzip
import json
import re
import statistics
import tempfile
from typing import NamedTuple

import jax
import jax.numpy as jnp

from tools.bench import cases, kernels, measure, parts

TURNS = 10
BYTES = {"pred": 1, "s8": 1, "u8": 1, "bf16": 2, "f16": 2, "f64": 8, "s64": 8}
USUAL_BYTES = 4
COPIED = 2**24
SHAPE = re.compile(r"\b(pred|[a-z]+\d+)\[([\d,]*)\]")
LINE = re.compile(r"\s*(?:ROOT )?%?(?P<name>[\w.-]+) = (?P<rest>.*)")
OPERATION = re.compile(r"[\s}](?P<kind>[a-z][\w-]*)\((?P<given>[^)]*)\)")
# What holds others, and is no time of its own; what is none.
OUTER = {"while", "conditional", "call", "parameter", "constant", "tuple"}
OUTER |= {"get-tuple-element", "bitcast"}
# The part of an operation: the first whose text its line holds.
PARTS = (
    ("look-ups", ("alignerf_lookup'",)),
    ("gradient of the look-ups", ("alignerf_lookup_gradient'",)),
    ("resampling", ("alignerf_resample'",)),
    ("proposals' loss", ("alignerf_interlevel'",)),
    ("Adam", ("alignerf_adam'", "/branch_1_fun/")),
    ("matrix products", ("dot_general", "Dense_", "/values/transpose")),
    ("field and proposals, the rest", ("/field/", "/proposal/")),
    ("samples, compositing", ("Model",)),
    ("losses", ("jvp()", "/jvp(")),
)
REST = "rays, counts, copies"


class Operation(NamedTuple):
    """A line of the compiled program: its part, bytes and floating-point operations."""

    part: str
    moved: int
    flop: int


def run(options):
    """Rows: the limits, then the parts, the slowest first."""
    return [*limits(options.quick), *rows()]


def limits(quick):
    """Rows of what one core does at the best."""
    side = 256 if quick else 2048
    yield limit("a large matrix product", "GFLOP/s", measure.matmul_peak(side) / 1e9)
    yield limit("a copy of 64 MB", "GB/s", copied_gb_s(COPIED // (64 * quick + 1)))


def rows():
    """Rows of the parts of a step."""
    step = kernels.training("grid", "auto", cases.orbit(width=64, height=64))
    operations = operations_of(step._step.as_text())
    taken = taken_us(functools.partial(parts.several, step), operations)
    sums = collections.defaultdict(lambda: [0.0, 0, 0, 0])
    for name, us in taken.items():
        part, moved, flop = operations[name]
        sums[part] = [
            a + b for a, b in zip(sums[part], (us, 1, moved, flop), strict=True)
        ]
    for part, (us, count, moved, flop) in sorted(sums.items(), key=lambda p: -p[1][0]):
        rates = f"{moved / us / 1e3:.1f} GB/s, {flop / us / 1e3:.1f} GFLOP/s"
        note = (
            f"{count} operations, {moved / 1e6:.1f} MB, {flop / 1e6:.1f} MFLOP: {rates}"
        )
        yield measure.Row(what=part, unit="us a step", ours=measure.one(us), note=note)


def limit(what, unit, value):
    return measure.Row(what=what, unit=unit, ours=measure.one(value))


def copied_gb_s(count):
    """GB/s, read and written, of a copy of so many floats."""
    x = jnp.ones(count)
    copy = jax.jit(lambda x: x + 1)
    times = measure.interleave({"copy": lambda: copy(x)}, 5)["copy"]
    return 2 * x.nbytes / min(times) / 1e9


def operations_of(text):
    """{name: `Operation`} of a compiled program's listing."""
    shapes, found = {}, {}
    for line in text.splitlines():
        if not (matched := LINE.match(line)):
            continue
        name, rest = matched["name"], matched["rest"]
        if not (operation := OPERATION.search(f" {rest}")):
            continue
        kind, given = operation["kind"], re.findall(r"%([\w.-]+)", operation["given"])
        made = rest[: operation.start()]
        shapes[name] = SHAPE.findall(made)
        if kind in OUTER:
            continue
        arrays = [*shapes[name], *(s for one in given for s in shapes.get(one, ()))]
        moved = sum(
            size_of(dims) * BYTES.get(kept, USUAL_BYTES) for kept, dims in arrays
        )
        found[name] = Operation(
            part_of(rest), moved, flop_of(rest, shapes, name, given)
        )
    return found


def size_of(dims):
    """Entries of an array, of its dimensions as text."""
    sizes = [int(size) for size in dims.split(",") if size]
    return functools.reduce(lambda a, b: a * b, sizes, 1)


def part_of(rest):
    """The part that an operation belongs to, by its target and where it comes from."""
    target = re.search(r'custom_call_target="(\w+)"', rest)
    source = re.search(r'op_name="([^"]*)"', rest)
    text = f"{target and target[1]}' {source[1] if source else ''}"
    for part, marks in PARTS:
        if any(mark in text for mark in marks):
            return part
    return REST


def flop_of(rest, shapes, name, given):
    """Of a matrix product twice the square root of the sizes of all three; else 0."""
    if not re.search(r"dot_general| dot\(", rest) or len(given) < 2:
        return 0
    sizes = [
        size_of(dims) for one in (name, *given[:2]) for _, dims in shapes.get(one, ())
    ]
    # [m, k] times [k, n] is [m, n]: m k, k n and m n multiplied are (m k n)^2.
    return 2 * round(functools.reduce(lambda a, b: a * b, sizes[:3], 1) ** 0.5)


def taken_us(call, operations):
    """{name: microseconds a step} of a program's operations, by the profiler."""
    call()
    with tempfile.TemporaryDirectory() as folder:
        with jax.profiler.trace(folder):
            for _ in range(TURNS):
                jax.block_until_ready(call())
        (path,) = glob.glob(f"{folder}/**/*.trace.json.gz", recursive=True)
        with gzip.open(path) as file:
            events = json.load(file)["traceEvents"]
    seen = collections.defaultdict(list)
    for event in events:
        if event.get("ph") == "X" and event.get("name") in operations:
            seen[event["name"]].append(event["dur"])
    steps = TURNS * parts.STEPS
    # A median: what else runs on the machine interrupts now and then.
    return {
        name: statistics.median(each) * len(each) / steps for name, each in seen.items()
    }
