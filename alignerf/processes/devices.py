"""The devices of a training: cores of a CPU, or accelerators.

On accelerators each job reserves one, or several, by file locks. On a CPU each core is
a device: a small model's operations are too short for XLA to share one between cores.
Two threads on two cores render a hash grid 1.9 times as fast as one does, and as two
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
from alignerf.kernels import compiler

log = logging.getLogger("alignerf")

# Beyond these, further devices have less to do and more gradients to add up.
MAX_DEVICES = 4
# The variable of a process's share of memory: its name now, and the one before.
MEMORY_SHARES = ("XLA_CLIENT_MEM_FRACTION", "XLA_PYTHON_CLIENT_MEM_FRACTION")
# Of compiled programs: those are kept that took longer, of them so many bytes.
KEPT_S, KEPT_BYTES = 0.5, 2**31
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


def begin(threads=None, gpus=1):
    """Take what a command may use: threads, accelerators, programs compiled before."""
    machine.limit(threads)
    if gpus < 0:
        raise ValueError(f"--gpus: {gpus} is not a number of accelerators")
    take_accelerators(gpus)
    keep_programs()


def keep_programs():
    """Let later processes find what this one compiles, in the user's cache.

    A folder that is named, as by a workflow, stays.
    """
    if "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return
    # Programs for one kind of processor can end the process on another.
    folder = compiler.folder() / machine.processor()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        # A home that is not there, or may not be written.
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", KEPT_S)
    jax.config.update("jax_compilation_cache_max_size", KEPT_BYTES)


def take_accelerators(wanted=1, device_files=Path("/dev"), locks=None):
    """Take NVIDIA accelerators of this host that no other job of this user has.

    As many as are wanted, or as are free. Nothing is taken on a host with one, and
    where CUDA_VISIBLE_DEVICES is set, as by Slurm: a job uses all that it sees. They
    are held until the process ends. Where each process takes a share of the memory
    (XLA_CLIENT_MEM_FRACTION), as many processes share an accelerator as fit. Raises
    ValueError where all are taken.
    """
    numbers = sorted(
        int(path.name.removeprefix("nvidia"))
        for path in device_files.glob("nvidia[0-9]*")
    )
    if len(numbers) < 2 or "CUDA_VISIBLE_DEVICES" in os.environ:
        return
    folder, taken = Path(locks or tempfile.gettempdir()), []
    # Empty ones first.
    for slot in range(int(1 / share_of_memory(os.environ))):
        for index, number in enumerate(numbers):
            if index in taken or len(taken) >= max(wanted, 1):
                continue
            name = f"alignerf-{os.getuid()}-gpu{number}-{slot}.lock"
            lock = filelock.FileLock(folder / name, timeout=0)
            with contextlib.suppress(OSError):  # taken, or another user's file
                lock.acquire()
                _held.append(lock)
                taken.append(index)
    if not taken:
        raise ValueError(
            f"all {len(numbers)} accelerators are taken: let no more jobs than that "
            f"run at once, by --resources gpu={len(numbers)}"
        )
    # CUDA numbers only those that a container shows, from 0.
    os.environ["CUDA_DEVICE_ORDER"] = "PCI_BUS_ID"
    os.environ["CUDA_VISIBLE_DEVICES"] = ",".join(map(str, taken))


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
