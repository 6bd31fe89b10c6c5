"""Commands of other programs: filled in, run without a shell, and ended whole.

And the job that they are of: an external training's slice of the config.
"""

import contextlib
import ctypes
import functools
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import NamedTuple

import psutil

from alignerf.experiment.checks import placeholders
from alignerf.io import faults, owned, provenance
from alignerf.io.environment import switches

# Below a training's folder: what the program learns from, and its model.
DATA, MODEL = "data", "model"
# What is asked to end has so many seconds to do so.
GRACE_S = 20.0
POLL_S = 0.02
# The signals that end a job.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Of the output, so many bytes are looked through for its last line.
TAIL_BYTES, LINE_CHARACTERS = 4096, 300
# Colours, and moves of a terminal's cursor.
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
# Linux: the signal that a process gets when its parent dies; whether what its children
# leave behind becomes its own child.
PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36


class Job(NamedTuple):
    """An external training's slice of the config.

    train, render: commands with names in braces, or None. renders, depth: folders of
    finished ones instead, or None. seed, steps: numbers that stand in the commands.
    """

    train: str | None = None
    render: str | None = None
    renders: str | None = None
    depth: str | None = None
    seed: int | None = None
    steps: int | None = None


def job_of(text) -> Job:
    """The job that a command's option holds, as JSON; ValueError where it is none."""
    try:
        return Job(**json.loads(text)["external"])
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"--config is no external job: {error}") from None


# Of the commands of an external job.
OPTIONS = {
    "[config]": "job as JSON",
    "scene": ("results/SCENE", Path),
    "[training]": ("its folder", Path),
    "[threads]": ("of the command", 1),
    "[gpus]": ("of the command", 0),
}


def run_of_job(template, args, **more) -> float:
    """Run a command of a job, its names in braces filled; returns its seconds.

    args: as of OPTIONS; more: further values. Folders are whole paths, as a
    command may change to another folder.
    """
    data = args.training / DATA
    values = {
        "data": faults.resolved(data),
        "model": faults.resolved(args.training / MODEL),
        "cores": args.threads,
        "seed": args.config.seed,
        "steps": args.config.steps,
        "scene": args.scene.name,
        "round": args.training.name.removeprefix("round"),
    }
    seconds = run(words_of(template, values | more), cores=args.threads)
    # What it keeps beside its data, as smaller photos, is no user's.
    if owned.is_marked(data):
        owned.seal(data)
    return seconds


def timing(steps, seconds):
    """The content of timing.json; what only the program knows is null.

    steps: None where they are not known; seconds: None of finished renders.
    """
    return {
        "stage": "external",
        "steps": steps,
        "rays_seen": None,
        "params": None,
        "train_time_s": seconds and round(seconds, 3),
        "compile_time_s": 0.0,
        "device": None,
    } | provenance.facts()


def words_of(template, values):
    """The words of a command line, {name: value} put into each.

    Words are split before values are put in, and no shell reads them: a value with
    spaces, quotes or `$(...)` is a part of its word. `~` is the user's home.
    """
    words = map(os.path.expanduser, shlex.split(template))
    return [placeholders.filled(word, values) for word in words]


def run(words, *, cores=1) -> float:
    """Run a command, and copy what it prints to stdout; returns its seconds.

    cores: what libraries that ask OMP_NUM_THREADS take, unless that is set already.
    Raises ValueError in one line where the program is missing or fails. Nothing that
    the command has started runs on when it has ended, or a signal ends this process.
    """
    control(PR_SET_CHILD_SUBREAPER, 1)
    kept = set(psutil.Process().children(recursive=True))
    print(faults.one_line(shlex.join(words)), flush=True)
    begun_s, asked, tail = time.perf_counter(), [], bytearray()
    # A signal between the start and the handlers would leave the command running.
    # One that is ignored, as under nohup, stays so.
    heard = [one for one in ENDING if signal.getsignal(one) is not signal.SIG_IGN]
    before = {one: signal.signal(one, lambda n, _: asked.append(n)) for one in heard}
    try:
        process = opened(words, cores)
        copying = threading.Thread(target=copy, args=(process, tail), daemon=True)
        copying.start()
        try:
            while process.poll() is None and not asked:
                time.sleep(POLL_S)
            took_s = time.perf_counter() - begun_s
        finally:
            end(process, kept)
            copying.join(1.0)
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
        if asked:
            # As the signal does where nothing handles it.
            signal.signal(asked[0], signal.SIG_DFL)
            os.kill(os.getpid(), asked[0])
    if process.returncode != 0:
        raise ValueError(f"{words[0]} {ending(process.returncode)}{said(tail)}")
    return took_s


def opened(words, cores):
    """A command, started; ValueError in one line where it cannot be."""
    try:
        return subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment(cores),
            start_new_session=True,
            preexec_fn=functools.partial(control, PR_SET_PDEATHSIG, signal.SIGTERM),
        )
    except FileNotFoundError:
        hint = "there is no such program; install it, or give its full path"
        raise ValueError(f"{words[0]}: {hint}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ValueError(f"{words[0]}: {reason}") from None


def copy(process, tail):
    """Copy a command's output to ours until it ends; the end of it is put into tail."""
    while chunk := os.read(process.stdout.fileno(), 65536):
        tail[:] = (tail + chunk)[-TAIL_BYTES:]
        # Who reads our output may have gone, as where all is being stopped.
        with contextlib.suppress(OSError):
            sys.stdout.buffer.write(chunk)
            sys.stdout.buffer.flush()


def end(process, kept):
    """Ask all that a command has started to end, and kill what does not.

    That is its process group and, also of other sessions, what this process has below
    it and `kept` has not. What waits for a disk cannot be killed, nor is waited for.
    """
    for number, wait_s in ((signal.SIGTERM, GRACE_S), (signal.SIGKILL, 1.0)):
        with contextlib.suppress(OSError):
            os.killpg(process.pid, number)
        below = set(psutil.Process().children(recursive=True)) - kept
        for one in below:
            with contextlib.suppress(psutil.Error):
                one.send_signal(number)
        psutil.wait_procs(below, wait_s)


def ending(code):
    """How a command ended, in words."""
    if code >= 0:
        return f"ended with exit code {code}"
    name = {one.value: one.name for one in signal.Signals}.get(-code, f"signal {-code}")
    hint = ", as where memory is short" if name == "SIGKILL" else ""
    return f"was ended by {name}{hint}"


def said(tail):
    """The last line of an output, behind a colon."""
    text = ESCAPES.sub("", tail.decode("utf-8", errors="replace"))
    lines = [line.strip() for line in re.split(r"[\r\n]", text) if line.strip()]
    if not lines:
        return "; it said nothing"
    return f"; its last line: {lines[-1][-LINE_CHARACTERS:]}"


def environment(cores=1):
    """Variables of a command: ours, without the way to our modules.

    It has its own environment, in which a module may have the name of one of ours. And
    it may need a variable that would change what ours compute.
    """
    found = switches.restored(os.environ)
    paths = found.pop("PYTHONPATH", "").split(os.pathsep)
    if kept := [path for path in paths if path and path != str(provenance.ROOT)]:
        found["PYTHONPATH"] = os.pathsep.join(kept)
    # Python would keep its lines to itself until there are many.
    return {"OMP_NUM_THREADS": str(cores), "PYTHONUNBUFFERED": "1"} | found


def control(option, value):
    """Set an option of this process, where the system can."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(option, value)
