"""The devices of a training: cores of a CPU, or accelerators.

On accelerators each job reserves one by a file lock. On a CPU each core is a device: a
small model's operations are too short for XLA to share one between cores. Two
threads on two cores render a hash grid 1.9 times as fast as one does, and as two
devices they train it 1.3 times as fast as one of two threads, an MLP 1.05 times.
"""

import contextlib
import logging
import math
import os
import tempfile
from pathlib import Path

import filelock
import jax
from jax.sharding import NamedSharding, PartitionSpec, SingleDeviceSharding

from alignerf.io import machine

log = logging.getLogger("alignerf")

# Beyond these, further devices have less to do and more gradients to add up.
MAX_DEVICES = 4
# The variable of a process's share of memory: its name now, and the one before.
MEMORY_SHARES = ("XLA_CLIENT_MEM_FRACTION", "XLA_PYTHON_CLIENT_MEM_FRACTION")
# Locks of accelerators that this process has taken.
_held = []


def use_as_devices():
    """Let every core be a device of JAX, where there is no accelerator.

    Call it before anything else uses JAX: later the devices stay as they are, and a
    warning says so. A number of devices in the user's XLA_FLAGS is kept.
    """
    if "xla_force_host_platform_device_count" in os.environ.get("XLA_FLAGS", ""):
        return
    wanted = min(machine.cores(), MAX_DEVICES)
    try:
        jax.config.update("jax_num_cpu_devices", wanted)
    except RuntimeError:
        devices = jax.local_devices()
        if devices[0].platform == "cpu" and len(devices) != wanted:
            log.warning(
                "too late for a device each of %d cores: JAX has started with %d",
                *(wanted, len(devices)),
            )


def take_accelerator(device_files=Path("/dev"), locks=None):
    """Take one of this host's NVIDIA accelerators that no other job of this user has.

    Nothing is taken on a host with one accelerator, and where CUDA_VISIBLE_DEVICES is
    set, as by Slurm. The accelerator is held until the process ends. Where each process
    takes a share of the memory (XLA_CLIENT_MEM_FRACTION), as many processes share an
    accelerator as fit. Raises ValueError where all are taken.
    """
    numbers = sorted(
        int(path.name.removeprefix("nvidia"))
        for path in device_files.glob("nvidia[0-9]*")
    )
    if len(numbers) < 2 or "CUDA_VISIBLE_DEVICES" in os.environ:
        return
    folder = Path(locks or tempfile.gettempdir())
    # Empty ones first.
    for slot in range(int(1 / share_of_memory(os.environ))):
        for index, number in enumerate(numbers):
            name = f"alignerf-{os.getuid()}-gpu{number}-{slot}.lock"
            lock = filelock.FileLock(folder / name, timeout=0)
            with contextlib.suppress(OSError):  # taken, or another user's file
                lock.acquire()
                _held.append(lock)
                # CUDA numbers only those that a container shows, from 0.
                os.environ["CUDA_DEVICE_ORDER"] = "PCI_BUS_ID"
                os.environ["CUDA_VISIBLE_DEVICES"] = str(index)
                return
    raise ValueError(
        f"all {len(numbers)} accelerators are taken: let no more jobs than that run at "
        f"once, by --resources gpu={len(numbers)}"
    )


def share_of_memory(environ) -> float:
    """The share of an accelerator's memory that the user gives each process, or 1."""
    for name in MEMORY_SHARES:
        if text := environ.get(name):
            try:
                share = float(text)
            except ValueError:
                share = math.nan
            if not 0.01 <= share <= 1:
                raise ValueError(f"environment: {name}={text!r:.40}: not from .01 to 1")
            return share
    return 1.0


def map_in_threads(function, items):
    """`machine.map_in_threads` on a CPU; an accelerator takes one at a time."""
    on_cpu = jax.local_devices()[0].platform == "cpu"
    return machine.map_in_threads(function, items, threads=None if on_cpu else 1)


def everywhere(mesh):
    """The sharding of what is whole on each device of a mesh, or on the only one."""
    if mesh is None:
        return SingleDeviceSharding(jax.local_devices()[0])
    return NamedSharding(mesh, PartitionSpec())


def place(tree, mesh):
    """The tree on the device, or whole on each of the mesh's.

    On a CPU, arrays at an aligned address are taken as they are, without a copy.
    """
    return jax.device_put(tree, everywhere(mesh))


def on_first(tree):
    """What `place` has placed, on the first device alone: no copy."""
    return jax.tree.map(lambda leaf: leaf.addressable_data(0), tree)
