"""Meet the other processes of a training, and end together with them."""

import contextlib
import logging
import os
import subprocess
import sys
import time
import traceback

import jax

from alignerf.files import faults
from alignerf.processes import rank

log = logging.getLogger("alignerf")

# A process that is silent for so long is given up: a frozen host, a cut cable. One that
# dies is noticed at once.
SILENT_S = 40
# How long processes wait for each other to start, and for the first one to write.
MEET_S, END_S = 120, 300
# What a collective of XLA says that has lost a process, and what we say then.
LOST = ("Gloo", "NCCL", "coordination", "Connection", "connection")
LOST_LINE = (
    "error: process {} of {}: another process of this training has ended, did not "
    "come, or does not answer"
)
# What C++ begins to say then; the rest is left out. Signals are left to the others.
SHORTEN = """
import re, signal, sys
for name in ("SIGINT", "SIGTERM", "SIGHUP"):
    signal.signal(getattr(signal, name), signal.SIG_IGN)
start = re.compile(rb"[EF]\\d{4} .*(coordination_service|client\\.h)")
noise = re.compile(rb"[WE]\\d{4} .*preemption_sync_manager")
said = False
for line in sys.stdin.buffer:
    said = said or line.startswith(b"error: ")
    if noise.match(line):
        continue
    if start.match(line):
        if not said:
            print(sys.argv[1], file=sys.stderr, flush=True)
        for line in sys.stdin.buffer:
            pass
        break
    sys.stderr.buffer.write(line)
    sys.stderr.buffer.flush()
"""
# The first process speaks first: what befalls all is said once, since a launcher ends
# the others with it.
HOLD_S = 5.0


@contextlib.contextmanager
def together():
    """Meet the other processes of a training, if any, before JAX starts.

    A failing process prints its error and exits at once. The others then exit too,
    reporting a lost peer.
    """
    rank.take(rank.from_environment(os.environ))
    if not rank.are_several():
        yield
        return
    try:
        join(os.environ)
        yield
        jax.distributed.shutdown()
        return
    except BaseException as error:
        end(error)


def end(error):
    """Print the error of this process and exit at once, without waiting for others."""
    try:
        if not rank.is_first():
            time.sleep(HOLD_S)
        say(error)
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        # Not sys.exit, which would wait for processes that wait for this one.
        os._exit(130 if isinstance(error, KeyboardInterrupt) else 1)


def say(error):
    """Print the error of this process with its rank; for our own faults a traceback."""
    number, count = rank.here()
    if isinstance(error, KeyboardInterrupt):
        return
    if is_lost(str(error)):
        print(f"{LOST_LINE.format(number, count)} ({error!s:.80})", file=sys.stderr)
        return
    if not isinstance(error, (ValueError, OSError)) or os.environ.get("ALIGNERF_DEBUG"):
        traceback.print_exception(error)
    message = " ".join(str(error).split()) or type(error).__name__
    message = faults.one_line(f"error: process {number} of {count}: {message}")
    print(message, file=sys.stderr)


def is_lost(text):
    """Whether an error's text is that of a collective that has lost a process.

    XLA's messages begin with a status in capitals.
    """
    status, _, rest = text.partition(": ")
    return status.isupper() and any(word in rest for word in LOST)


def join(environ):
    """Connect to the other processes; JAX then sees the devices of all processes."""
    number, count = rank.here()
    options = {"num_processes": count, "process_id": number}
    if environ.get(rank.BY_HAND[0]):
        options["cluster_detection_method"] = "deactivate"
    else:
        environ.setdefault("JAX_COORDINATOR_PORT", str(rank.port(environ)))
        options["local_device_ids"] = rank.accelerators(environ)
    shorten_stderr()
    try:
        jax.distributed.initialize(
            **options,
            heartbeat_timeout_seconds=SILENT_S,
            initialization_timeout=MEET_S,
            shutdown_timeout_seconds=END_S,
        )
    except (RuntimeError, ValueError) as error:
        where = environ.get(rank.ADDRESS, "the address that the launcher gives")
        raise ValueError(
            f"{count} processes do not meet at {where} within {MEET_S} s: "
            f"{str(error).splitlines()[0]:.200}"
        ) from None
    if not rank.is_first():
        # What all do is said once.
        log.setLevel(logging.ERROR)


def shorten_stderr():
    """From now on, shorten the C++ trace of a lost process to one line.

    JAX ends a process that has lost the first one, or that waits for a frozen one, with
    an abort from a thread of its own, which no code of ours can catch. So stderr is
    piped through another process, which outlives this one.
    """
    read, write = os.pipe()
    command = [sys.executable, "-c", SHORTEN, LOST_LINE.format(*rank.here())]
    subprocess.Popen(command, stdin=read, stderr=sys.stderr.fileno())
    os.dup2(write, sys.stderr.fileno())
    os.close(read)
    os.close(write)
