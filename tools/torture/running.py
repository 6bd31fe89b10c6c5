"""A command under limits: what it said, how long it took, and how much it held."""

import os
import re
import resource
import signal
import subprocess
import tempfile
import time
from typing import NamedTuple

from alignerf.io import machine

# Of `make torture`: how many of what has no end, another seed each day.
CASES = int(os.environ.get("TORTURE_CASES", 0))
SEED = int(os.environ.get("TORTURE_SEED", 0))
MAX_S = 10.0
MAX_MIB = 2048
# A loaded machine is slower than the limit means: only then is a command ended.
ENDED_S = 180.0
# Of the clock's seconds: what works less than this share waits.
WORKED = 0.15


def variables(place):
    """Of a stage in a copy of a finished chain: on CPUs, by programs compiled once."""
    found = {
        "JAX_PLATFORMS": "cpu",
        "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0.5",
    }
    # One of each kind of processor.
    caches = [*(place / "results" / ".jax_cache").glob("*")]
    return found | ({"JAX_COMPILATION_CACHE_DIR": str(caches[0])} if caches else {})


class Ended(NamedTuple):
    """How a command ended."""

    code: int
    output: str
    time_s: float
    peak_mib: float


def run(command, folder, environment=None) -> Ended:
    """Run a command in a folder until it ends, or is ended after ENDED_S.

    time_s are seconds of processor, which other jobs beside it do not lengthen; of a
    command that waits, or works in many threads, those of the clock.
    """
    started = time.perf_counter()
    with tempfile.TemporaryFile() as said:
        child = subprocess.Popen(
            command,
            cwd=folder,
            env=os.environ | (environment or {}),
            stdin=subprocess.DEVNULL,
            stdout=said,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        usage, peak_mib = wait(child, started + ENDED_S)
        clock_s = time.perf_counter() - started
        said.seek(0)
        output = said.read().decode(errors="replace")
    spent_s = usage.ru_utime + usage.ru_stime
    # Most of the time spent waiting is no other job's doing, unless these are many.
    crowd = max(1.0, os.getloadavg()[0] / machine.cores())
    waited = spent_s < WORKED * clock_s / crowd
    return Ended(
        code=child.returncode,
        output=output,
        time_s=clock_s if waited else min(clock_s, spent_s),
        peak_mib=peak_mib,
    )


def wait(child, until) -> tuple[resource.struct_rusage, float]:
    """Wait for a child, and end its whole session when it is over time.

    Returns its usage, and its peak of memory in MiB.
    """
    peak_mib = 0.0
    while True:
        peak_mib = max(peak_mib, held_mib(child.pid))
        pid, status, usage = os.wait4(child.pid, os.WNOHANG)
        if pid:
            child.returncode = os.waitstatus_to_exitcode(status)
            return usage, peak_mib
        if time.perf_counter() > until:
            os.killpg(child.pid, signal.SIGKILL)
            until = float("inf")
        time.sleep(0.01)


def held_mib(pid):
    """The most that a process has held so far; 0 where the system does not say.

    Not that of wait4: it begins with what the process held that started this one.
    """
    try:
        with open(f"/proc/{pid}/status") as file:
            found = re.search(r"VmHWM:\s+(\d+)", file.read())
    except OSError:
        return 0.0
    return int(found[1]) / 1024 if found else 0.0


def fault_of(ended: Ended, names) -> str | None:
    """What is wrong with how a refusal was said; None where it is as it should be.

    names: of files and keys, one of which the line has to name.
    """
    if ended.time_s > MAX_S:
        return f"{ended.time_s:.0f} s"
    if ended.peak_mib > MAX_MIB:
        return f"{ended.peak_mib:.0f} MiB"
    if ended.code != 1:
        return f"exit {ended.code}"
    if "Traceback" in ended.output:
        return "traceback"
    lines = [line for line in ended.output.splitlines() if line.startswith("error: ")]
    if len(lines) != 1:
        return f"{len(lines)} lines of error"
    if not any(name in lines[0] for name in names):
        return "names neither file nor key"
    return None
