"""Values on which all processes of a training agree: those of the first.

Each function is a collective: all processes call it, in the same order. With one
process it returns what it is given, and does not start JAX.
"""

import json
import time

import jax
import numpy as np
from jax.experimental import multihost_utils

from alignerf.files import faults
from alignerf.processes import rank


def on(value):
    """The first process's JSON-able value, in all processes."""
    if not rank.are_several():
        return value
    return json.loads(on_bytes(json.dumps(value).encode()))


def on_bytes(data: bytes) -> bytes:
    """The first process's bytes, less than 2 GiB, in all processes."""
    if not rank.are_several():
        return data
    mine = np.frombuffer(data, np.uint8)
    if mine.size >= 2**31:
        raise ValueError(f"{mine.size} bytes are too many to tell other processes")
    size = int(multihost_utils.broadcast_one_to_all(np.int32(mine.size)))
    mine = mine if rank.is_first() else np.zeros(size, np.uint8)
    sent = multihost_utils.broadcast_one_to_all(mine)
    return np.asarray(sent, np.uint8).tobytes()


def on_arrays(tree):
    """The first process's arrays, in all processes, where they have the same shapes."""
    if not rank.are_several():
        return tree
    return jax.tree.map(np.asarray, multihost_utils.broadcast_one_to_all(tree))


def check_same(digest, what):
    """ValueError where a process has another SHA-256 of `what` than the first."""
    if not rank.are_several():
        return
    mine = np.frombuffer(bytes.fromhex(digest), np.uint8)
    every = np.asarray(multihost_utils.process_allgather(mine))
    others = np.flatnonzero((every != every[0]).any(axis=1))
    if others.size:
        numbers = faults.some_names([str(number) for number in others])
        raise ValueError(f"{what}: not the same in process {numbers} as in process 0")


def on_smallest(size: int) -> int:
    """The smallest of the processes' sizes in bytes, rounded down to a megabyte."""
    if not rank.are_several():
        return size
    every = multihost_utils.process_allgather(np.int32(size // 10**6))
    return int(np.min(every)) * 10**6


def clock() -> float:
    """The first process's clock in s, so that all processes decide alike by it."""
    return on(time.perf_counter())
