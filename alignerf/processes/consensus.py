"""Processes that train one model: how they meet, and values on which they agree.

The agreed values are those of the first process. Each function on values is a
collective: all processes call it, in the same order. With one process it returns what
it is given, and does not start JAX.
"""

import contextlib
import json
import logging
import os
import sys
import time
import traceback

import jax
import numpy as np
from jax.experimental import multihost_utils

from alignerf.io import faults

log = logging.getLogger("alignerf")

# By hand; and how mpirun and srun tell a process of how many it is one. mpirun first:
# inside a step of Slurm's both speak.
BY_HAND = ("JAX_NUM_PROCESSES", "JAX_PROCESS_ID")
COUNTS = (BY_HAND[0], "OMPI_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")


@contextlib.contextmanager
def together(environ=os.environ):
    """Meet the other processes of a training, if any, before JAX starts.

    JAX finds those that `srun` or `mpirun` has started. By hand a user sets
    JAX_COORDINATOR_ADDRESS (host:port of the first process) and BY_HAND. A failing
    process prints its error and exits at once: the others then lose a peer, and end.
    """
    if int(next((environ[name] for name in COUNTS if environ.get(name)), 1)) == 1:
        yield
        return
    by_hand = [int(environ[name]) for name in BY_HAND if environ.get(name)]
    try:
        jax.distributed.initialize(None, *by_hand)
        if not is_first():
            # What all do is said once.
            log.setLevel(logging.ERROR)
        yield
        jax.distributed.shutdown()
    except BaseException as error:
        if isinstance(error, (ValueError, OSError)):
            faults.say(error)
        else:
            traceback.print_exception(error)
        sys.stdout.flush()
        sys.stderr.flush()
        # Not sys.exit, which would wait for processes that wait for this one.
        os._exit(1)


def are_several() -> bool:
    """Whether there are other processes."""
    return jax.distributed.is_initialized()


def is_first() -> bool:
    """Whether this process reads checkpoints and writes files."""
    return not are_several() or jax.process_index() == 0


def count() -> int:
    """The number of processes of this training."""
    return jax.process_count() if are_several() else 1


def on(value):
    """The first process's JSON-able value, in all processes."""
    if not are_several():
        return value
    return json.loads(on_bytes(json.dumps(value).encode()))


def on_bytes(data: bytes) -> bytes:
    """The first process's bytes, less than 2 GiB, in all processes."""
    if not are_several():
        return data
    mine = np.frombuffer(data, np.uint8)
    size = int(multihost_utils.broadcast_one_to_all(np.int32(mine.size)))
    mine = mine if is_first() else np.zeros(size, np.uint8)
    sent = multihost_utils.broadcast_one_to_all(mine)
    return np.asarray(sent, np.uint8).tobytes()


def on_arrays(tree):
    """The first process's arrays, in all processes, where they have the same shapes."""
    if not are_several():
        return tree
    return jax.tree.map(np.asarray, multihost_utils.broadcast_one_to_all(tree))


def check_same(digest, what):
    """ValueError where a process has another SHA-256 of `what` than the first."""
    if not are_several():
        return
    mine = np.frombuffer(bytes.fromhex(digest), np.uint8)
    every = np.asarray(multihost_utils.process_allgather(mine))
    if (every != every[0]).any():
        number = int(np.flatnonzero((every != every[0]).any(axis=1))[0])
        raise ValueError(f"{what}: not the same in process {number} as in process 0")


def on_smallest(size: int) -> int:
    """The smallest of the processes' sizes in bytes, rounded down to a megabyte."""
    if not are_several():
        return size
    every = multihost_utils.process_allgather(np.int32(size // 10**6))
    return int(np.min(every)) * 10**6


def clock() -> float:
    """The first process's clock in s, so that all processes decide alike by it."""
    return on(time.perf_counter())
