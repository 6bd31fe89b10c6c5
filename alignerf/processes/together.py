"""Meet the other processes of a training, and end together with them."""

import contextlib
import logging
import os
import subprocess
import sys
import time
import traceback

import jax

from alignerf.command import faults
from alignerf.processes import place

log = logging.getLogger("alignerf")

# A process that is silent for so long is given up: a frozen host, a cut cable. One that
# dies is noticed at once.
SILENT_S = 40
# How long the first process waits for the others to start, or they for it to end.
MEET_S = 300
# What a collective of XLA says that has lost a process, and what we say then.
LOST = ("Gloo", "NCCL", "UNAVAILABLE", "coordination service")
LOST_LINE = (
    "error: process {} of {}: another process of this training has ended, or does "
    "not answer: its own line says why"
)
# What C++ begins to say then; the rest is left out. Signals are left to the others.
SHORTEN = """
import re, signal, sys
for name in ("SIGINT", "SIGTERM", "SIGHUP"):
    signal.signal(getattr(signal, name), signal.SIG_IGN)
start = re.compile(rb"[EF]\\d{4} .*(coordination_service|client.h)")
said = False
for line in sys.stdin.buffer:
    said = said or line.startswith(b"error: ")
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
    """Meet the other processes of a training, where it has some, before JAX starts.

    One that fails says why and ends at once, whatever the others wait for; they then
    fail as well, and say that they have lost it.
    """
    place.take(place.of(os.environ))
    if not place.are_several():
        yield
        return
    code = 1
    try:
        join(os.environ)
        yield
        jax.distributed.shutdown()
        return
    except (ValueError, OSError, RuntimeError) as error:
        if not place.is_first():
            time.sleep(HOLD_S)
        say(error)
    except KeyboardInterrupt:
        code = 130
    except Exception:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    # Not sys.exit, which would wait for processes that wait for this one.
    os._exit(code)


def say(error):
    """Print what ended this process, with its number."""
    if is_lost(str(error)):
        print(LOST_LINE.format(*place.here()), file=sys.stderr)
        return
    if isinstance(error, RuntimeError):
        traceback.print_exception(error)
    number, count = place.here()
    faults.say(ValueError(f"process {number} of {count}: {error}"))


def is_lost(text):
    """Whether a message is that of a collective whose other side is gone."""
    return any(word in text for word in LOST)


def join(environ):
    """Connect to the other processes; all of JAX's devices are then those of all."""
    number, count = place.here()
    options = {"num_processes": count, "process_id": number}
    if environ.get(place.BY_HAND[0]):
        options["cluster_detection_method"] = "deactivate"
    else:
        environ.setdefault("JAX_COORDINATOR_PORT", str(place.port(environ)))
        options["local_device_ids"] = place.accelerators(environ)
    shorten_stderr()
    jax.distributed.initialize(
        **options,
        heartbeat_timeout_seconds=SILENT_S,
        initialization_timeout=MEET_S,
        shutdown_timeout_seconds=MEET_S,
    )
    if not place.is_first():
        # What all do is said once.
        log.setLevel(logging.ERROR)


def shorten_stderr():
    """Let a page of C++ on a lost process be one line, from now on.

    JAX ends a process that has lost the first one, or that waits for a frozen one, with
    an abort from a thread of its own, which no code of ours can see. So what is
    written to stderr passes through another process, which outlives it.
    """
    read, write = os.pipe()
    command = [sys.executable, "-c", SHORTEN, LOST_LINE.format(*place.here())]
    subprocess.Popen(command, stdin=read, stderr=sys.stderr.fileno())
    os.dup2(write, sys.stderr.fileno())
    os.close(read)
    os.close(write)
