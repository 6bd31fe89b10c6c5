"""How the benchmarks time: interleaved arms, medians, pairs.

Notation: a rate is work / seconds; a ratio is how many times faster ours is than the
peer, one for each pair of neighbours in time: a slow minute of the machine hits both.
"""

import dataclasses
import json
import operator
import os
import pathlib
import statistics
import subprocess
import sys
import time

import jax
import jax.numpy as jnp

ROOT = pathlib.Path(__file__).resolve().parents[2]
RELATIONS = {">=": operator.ge, "<=": operator.le}


@dataclasses.dataclass(frozen=True)
class Spread:
    """Median of `count` values, the least and the largest of them."""

    median: float
    low: float
    high: float
    count: int


@dataclasses.dataclass(frozen=True)
class Goal:
    """What a row is held to: its `ours` or its `ratio`, `>=` or `<=`, a value."""

    column: str
    relation: str
    value: float

    def met(self, row):
        """True, False, or None where the column is empty."""
        found = getattr(row, self.column)
        return found and RELATIONS[self.relation](found.median, self.value)


@dataclasses.dataclass(frozen=True)
class Row:
    """One line of a benchmark's table; an empty column is None."""

    what: str
    unit: str
    ours: Spread | None
    peer: Spread | None = None
    ratio: Spread | None = None
    goal: Goal | None = None
    note: str = ""


def spread(values) -> Spread:
    """Of one value or more."""
    values = [float(value) for value in values]
    return Spread(statistics.median(values), min(values), max(values), len(values))


def one(value) -> Spread:
    """A number that is not repeated."""
    return spread([value])


def elsewhere(module, request, **environment):
    """The JSON that `python -m module request` prints last, in its own process."""
    done = subprocess.run(
        [sys.executable, "-m", module, json.dumps(request)],
        cwd=ROOT,
        env=os.environ | environment,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise RuntimeError(f"{module} failed:\n{done.stderr}")
    return json.loads(done.stdout.splitlines()[-1])


def seconds(call, clock=time.perf_counter):
    """Of one call, until all that it returns has been computed."""
    start = clock()
    jax.block_until_ready(call())
    return clock() - start


def interleave(arms, repeats, *, clock=time.perf_counter):
    """Seconds {name: [repeats]} of the arms {name: call}: A B A B, compiled before.

    clock: what counts them, as `time.process_time` for those of this process's cores.
    """
    times = {name: [] for name in arms}
    for call in arms.values():
        seconds(call)
    for _ in range(repeats):
        for name, call in arms.items():
            times[name].append(seconds(call, clock))
    return times


def rates(what, times, work, *, goal=None, note="", unit="rays/s") -> Row:
    """A row of rates from the seconds of `ours` and, where there is one, `peer`."""
    ours, peer = times["ours"], times.get("peer")
    return Row(
        what=what,
        unit=unit,
        ours=spread(work / s for s in ours),
        peer=peer and spread(work / s for s in peer),
        ratio=peer and spread(p / s for s, p in zip(ours, peer, strict=True)),
        goal=goal,
        note=note,
    )


def matmul_peak(side, dtype="float32", repeats=5):
    """Best FLOP/s of a product of two square matrices, at the default precision."""
    a = jnp.ones((side, side), dtype)
    product = jax.jit(jnp.matmul)
    times = interleave({"product": lambda: product(a, a)}, repeats)["product"]
    return 2 * side**3 / min(times)
