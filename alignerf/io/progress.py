"""A progress line for long loops: a bar on a terminal, a line now and then in a log."""

import contextlib
import functools
import re
import sys
import threading
import time
from typing import NamedTuple

import tqdm

# A line in a log, as `Progress` and `heartbeat` write it.
STEPS = re.compile(r"(.*): (\w+) (\d+)/(\d+)  .*?eta (\d+):(\d\d)")
BEATS = re.compile(r"(.*): for \d+:\d\d")


class Shown(NamedTuple):
    """What a line says of a long loop; None stands for what is not known."""

    text: str
    left_s: float | None = None


def read(line):
    """The `Shown` of a line in a log; None of any other line."""
    if found := STEPS.match(line):
        _, unit, done, total, minutes, seconds = found.groups()
        return Shown(f"{unit} {done}/{total}", 60 * int(minutes) + int(seconds))
    return Shown(line) if BEATS.fullmatch(line) else None


class Progress:
    """Counts steps; shows numbers, speed and the time left."""

    log_every_s = 10.0

    def __init__(self, title, total, *, done=0, unit="step"):
        self.title, self.total, self.done, self.unit = title, total, done, unit
        self.bar = None
        self.first, self.start = done, time.perf_counter()
        self.shown = self.start
        if sys.stderr.isatty():
            self.bar = tqdm.tqdm(desc=title, total=total, initial=done, unit=unit)

    def advance(self, count=1, **numbers):
        """`count` further steps; `numbers` are shown as name value."""
        self.done += count
        now = time.perf_counter()
        seldom = now - self.shown < self.log_every_s and self.done < self.total
        if seldom and self.bar is None:
            return
        text = "  ".join(f"{name} {value:.4g}" for name, value in numbers.items())
        if self.bar is not None:
            self.bar.set_postfix_str(text, refresh=False)
            self.bar.update(count)
            return
        self.shown = now
        step_s = (now - self.start) / max(self.done - self.first, 1)
        minutes, seconds = divmod(round((self.total - self.done) * step_s), 60)
        line = f"{self.title}: {self.unit} {self.done}/{self.total}  {text}  "
        line += f"eta {minutes}:{seconds:02d}"
        print(line, file=sys.stderr, flush=True)

    def close(self):
        if self.bar is not None:
            self.bar.close()


def over(items, title, *, unit="view", total=None):
    """Yield the items, and show how many are done; total: of an iterator."""
    items = list(items) if total is None else items
    shown = Progress(title, len(items) if total is None else total, unit=unit)
    with contextlib.closing(shown):
        for item in items:
            yield item
            shown.advance()


@contextlib.contextmanager
def every(seconds, call):
    """Call a function from time to time, in a thread, while a block runs."""
    done = threading.Event()

    def beat():
        while not done.wait(seconds):
            call()

    thread = threading.Thread(target=beat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join()


def beat(title, start):
    """Log for how long an operation runs that has begun at `start`."""
    minutes, seconds = divmod(round(time.perf_counter() - start), 60)
    print(f"{title}: for {minutes}:{seconds:02d}", file=sys.stderr, flush=True)


def heartbeat(title, every_s=15.0):
    """Log from time to time that a long operation without steps still runs."""
    return every(every_s, functools.partial(beat, title, time.perf_counter()))


@contextlib.contextmanager
def watched(title, total, count, *, unit, every_s=10.0):
    """Show how far an operation is that does not tell it by itself.

    count: a function, called in a thread; how many of `total` are done.
    """
    shown = Progress(title, total, unit=unit)
    shown.log_every_s = 0.0

    def look():
        further = min(count(), total) - shown.done
        if further <= 0 and not shown.done and shown.bar is None:
            beat(title, shown.start)
        else:
            shown.advance(max(further, 0))

    with contextlib.closing(shown), every(every_s, look):
        yield
