"""What a command may use of the machine that it runs on."""

import concurrent.futures
import hashlib
import os
import platform
import re
import resource
import sys
from pathlib import Path

# Device files of NVIDIA's and AMD's drivers, and of Google's TPUs.
ACCELERATORS = ("nvidia[0-9]*", "kfd", "accel[0-9]*")
# Lines of /proc/cpuinfo, on x86 and on ARM.
FLAGS = ("flags", "features")
_limit = None


def cores() -> int:
    """Cores that this process may use: fewer than there are in a container, say."""
    if hasattr(os, "sched_getaffinity"):
        count = len(os.sched_getaffinity(0))
    else:
        count = os.cpu_count() or 1
    return min(count, _limit or count)


def limit(threads: int | None):
    """Let this process use no more cores than `threads`; None is no limit.

    JAX reads the variable when it starts: on a CPU it computes in as many threads.
    """
    global _limit
    if threads is None:
        return
    if threads < 1:
        raise ValueError(f"--threads: {threads} is not a number of threads")
    _limit = threads
    os.environ["PJRT_NPROC"] = str(threads)


def map_in_threads(function, items, *, threads=None):
    """Yield function(item) of all items in order, from a thread for each core.

    A failure is raised in its item's turn, and what has not begun is left.
    """
    pool = concurrent.futures.ThreadPoolExecutor(threads or cores())
    try:
        yield from pool.map(function, items)
    finally:
        pool.shutdown(cancel_futures=True)


def processor(cpuinfo=Path("/proc/cpuinfo")) -> str:
    """A short name of the kind of processor; programs for one kind run on all of it.

    Its architecture and, on Linux, a hash of the abilities that the first core lists.
    """
    architecture = platform.machine()
    try:
        lines = cpuinfo.read_text().splitlines()
    except OSError:
        return architecture
    flags = next((line for line in lines if line.lower().startswith(FLAGS)), "")
    return f"{architecture}-{hashlib.sha256(flags.encode()).hexdigest()[:8]}"


def peak_bytes() -> int:
    """Peak memory of this process; on Linux since /proc/self/clear_refs was written."""
    try:
        status = Path("/proc/self/status").read_text()
        return 1024 * int(re.search(r"VmHWM:\s+(\d+)", status)[1])
    except (OSError, TypeError):
        # Elsewhere it may be the peak of the process that started this one.
        unit = 1 if sys.platform == "darwin" else 1024
        return unit * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def accelerators(devices=Path("/dev")) -> int:
    """How many GPUs or TPUs there are, as far as the folder of devices tells."""
    return sum(len([*devices.glob(name)]) for name in ACCELERATORS)
