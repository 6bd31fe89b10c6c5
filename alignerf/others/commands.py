"""Commands of other programs: filled in, run without a shell, and stopped whole."""

import contextlib
import ctypes
import functools
import os
import re
import selectors
import shlex
import signal
import subprocess
import sys
import threading
import time

import psutil

from alignerf.experiment.checks import places
from alignerf.files import faults, provenance
from alignerf.files.environment import switches

# A command that is asked to end has so many seconds to do so.
GRACE_S = 20.0
# The signals that end a job; all that its command has started gets them too.
ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Of the output, so many bytes are looked through for its last line.
TAIL_BYTES, LINE_CHARACTERS = 4096, 300
# Colours, and moves of a terminal's cursor.
ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
# Linux: the signal that a process gets when its parent dies; whether what its children
# leave behind becomes its own child.
PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36


def words_of(template, values):
    """The words of a command line, {name: value} put into each.

    Words are split before values are put in, and no shell reads them: a value with
    spaces, quotes or `$(...)` is a part of its word. `~` is the user's home.
    """
    words = map(os.path.expanduser, shlex.split(template))
    return [places.filled(word, values) for word in words]


def run(words, *, cores=1) -> float:
    """Run a command, and copy what it prints to stdout; returns its seconds.

    cores: what libraries that ask OMP_NUM_THREADS take, unless that is set already.
    Raises ValueError in one line where the program is missing or fails. Nothing that
    the command has started runs on when it has ended, or a signal ends this process.
    """
    control(PR_SET_CHILD_SUBREAPER, 1)
    kept = set(psutil.Process().children(recursive=True))
    print(faults.one_line(shlex.join(words)), flush=True)
    begun = time.perf_counter()
    try:
        process = subprocess.Popen(
            words,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=environment(cores),
            start_new_session=True,
            preexec_fn=functools.partial(control, PR_SET_PDEATHSIG, signal.SIGTERM),
        )
    except (OSError, ValueError) as error:
        raise ValueError(f"{words[0]}: {reason_of(error)}") from None
    send = functools.partial(send_to, process.pid, kept)
    with process, passing_on(send) as asked:
        try:
            tail = copied(process)
            code, took = process.wait(), time.perf_counter() - begun
        finally:
            end(send)
    if asked:
        # As the signal does where nothing handles it.
        signal.signal(asked[0], signal.SIG_DFL)
        os.kill(os.getpid(), asked[0])
    if code != 0:
        raise ValueError(f"{words[0]} {ending(code)}{said(tail)}")
    return took


def reason_of(error):
    """Why a program cannot be started."""
    if isinstance(error, FileNotFoundError):
        return "there is no such program; install it, or give its full path"
    return getattr(error, "strerror", None) or str(error)


def ending(code):
    """How a command ended, in words."""
    if code >= 0:
        return f"ended with exit code {code}"
    try:
        name = signal.Signals(-code).name
    except ValueError:
        name = f"signal {-code}"
    hint = ", as where memory is short" if name == "SIGKILL" else ""
    return f"was ended by {name}{hint}"


def said(tail):
    """The last line of an output, behind a colon."""
    text = ESCAPES.sub("", tail.decode("utf-8", errors="replace"))
    lines = [line.strip() for line in re.split(r"[\r\n]", text)]
    last = next((line for line in reversed(lines) if line), "")
    return (
        f"; its last line: {last[-LINE_CHARACTERS:]}" if last else "; it said nothing"
    )


def environment(cores=1):
    """Variables of a command: ours, without the way to our modules.

    It has its own environment, in which a module may have the name of one of ours. And
    it may need a variable that would change what ours compute.
    """
    found = switches.restored(os.environ)
    paths = found.get("PYTHONPATH", "").split(os.pathsep)
    kept = [path for path in paths if path and path != str(provenance.ROOT)]
    found["PYTHONPATH"] = os.pathsep.join(kept)
    if not kept:
        del found["PYTHONPATH"]
    found.setdefault("OMP_NUM_THREADS", str(cores))
    # Python would keep its lines to itself until there are many.
    found.setdefault("PYTHONUNBUFFERED", "1")
    return found


def control(option, value):
    """Set an option of this process, where the system can."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(option, value)


@contextlib.contextmanager
def passing_on(send):
    """Pass ENDING on to a command by `send`; yields a list, of the signal that came."""
    asked, timers = [], []

    def handle(number, frame):
        asked.append(number)
        send(number)
        if not timers:
            timers.append(threading.Timer(GRACE_S, send, (signal.SIGKILL,)))
            timers[0].daemon = True
            timers[0].start()

    before = {number: signal.signal(number, handle) for number in ENDING}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for timer in timers:
            timer.cancel()


def send_to(group, kept, number) -> bool:
    """Send a signal to all of a command that runs; whether anything does.

    That is its process group and, also of other sessions, what this process has below
    it and `kept` has not.
    """
    below, found = set(psutil.Process().children(recursive=True)) - kept, False
    for one in below.union(psutil.process_iter()):
        with contextlib.suppress(OSError, psutil.Error):
            own = one in below or os.getpgid(one.pid) == group
            if own and one.status() != psutil.STATUS_ZOMBIE:
                one.send_signal(number)
                found = True
    return found


def end(send):
    """Ask what a command has left behind to end, and kill what does not."""
    last = time.monotonic() + GRACE_S
    send(signal.SIGTERM)
    # What waits for a disk cannot be killed, and is not waited for.
    while (late := time.monotonic() - last) < 1 and send(signal.SIGKILL * (late > 0)):
        time.sleep(0.05)


def copied(process) -> bytes:
    """Copy a command's output to ours until it ends; returns the end of it.

    Something that it has left in the background may keep its output open for longer.
    """
    tail, output = b"", process.stdout.fileno()
    with selectors.DefaultSelector() as selector:
        selector.register(output, selectors.EVENT_READ)
        while True:
            ended = process.poll() is not None
            if not selector.select(timeout=0.0 if ended else 0.2):
                if ended:
                    return tail
                continue
            if not (chunk := os.read(output, 65536)):
                return tail
            tail = (tail + chunk)[-TAIL_BYTES:]
            # Who reads our output may have gone, as where all is being stopped.
            with contextlib.suppress(OSError):
                sys.stdout.buffer.write(chunk)
                sys.stdout.buffer.flush()
