"""A command under limits: what it said, how long it took, and how much it held."""

import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from typing import NamedTuple

MOST_S = 10.0
MOST_MIB = 2048
# A loaded machine is slower than the limit means: only then is a command ended.
ENDED_S = 180.0


class Ended(NamedTuple):
    """How a command ended."""

    code: int
    output: str
    time_s: float
    peak_mib: float


def run(command, folder, environment=None) -> Ended:
    """Run a command in a folder until it ends, or is ended after ENDED_S.

    time_s are seconds of processor, which other jobs beside it do not lengthen; a
    command that waits, or works in many threads, has the clock's instead.
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
        usage = wait(child, started + ENDED_S)
        clock_s = time.perf_counter() - started
        said.seek(0)
        output = said.read().decode(errors="replace")
    spent_s = usage.ru_utime + usage.ru_stime
    waited = clock_s >= ENDED_S
    return Ended(
        code=child.returncode,
        output=output,
        time_s=clock_s if waited else min(clock_s, spent_s),
        peak_mib=usage.ru_maxrss / (2**20 if sys.platform == "darwin" else 1024),
    )


def wait(child, until) -> resource.struct_rusage:
    """Wait for a child, and end its whole session when it is over time."""
    while True:
        pid, status, usage = os.wait4(child.pid, os.WNOHANG)
        if pid:
            child.returncode = os.waitstatus_to_exitcode(status)
            return usage
        if time.perf_counter() > until:
            os.killpg(child.pid, signal.SIGKILL)
            until = float("inf")
        time.sleep(0.01)


def fault_of(ended: Ended, names) -> str | None:
    """What is wrong with how a refusal was said; None where it is as it should be.

    names: of files and keys, one of which the line has to name.
    """
    if ended.time_s > MOST_S:
        return f"{ended.time_s:.0f} s"
    if ended.peak_mib > MOST_MIB:
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
