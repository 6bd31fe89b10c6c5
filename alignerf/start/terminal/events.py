"""Snakemake as a child that tells what it does, while its own text goes to a file.

A plugin of this project's tells it (workflow/plugins), through a pipe. A reader that is
gone does not stop a run, and a run without events is none that fails.
"""

import contextlib
import json
import os
import queue
import signal
import subprocess
import threading

import psutil

from alignerf.experiment import sources

PLUGIN, FILE_DESCRIPTOR = "alignerf-events", "ALIGNERF_EVENTS_FD"
# How long the last events may take after the end of the process.
LAST_S = 5.0
# Who has begun a job since the first time is asked to end it.
AGAIN_S = 2.0
# How long Snakemake may take from then on.
STUCK_S = 30.0


class Child:
    """Snakemake's process; its events come out of `next`.

    command: as Snakemake is called. log: the file of all that it prints.
    """

    def __init__(self, command, log):
        self.events = queue.SimpleQueue()
        reading, writing = os.pipe()
        environment = dict(os.environ) | {FILE_DESCRIPTOR: str(writing)}
        # Snakemake takes a plugin that it finds; jobs have no need of it.
        paths = [str(sources.PLUGINS), environment.get("PYTHONPATH", "")]
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, paths))
        with open(log, "wb") as file:
            self.process = subprocess.Popen(
                command,
                env=environment,
                pass_fds=[writing],
                stdout=file,
                stderr=subprocess.STDOUT,
            )
        os.close(writing)
        self.reader = threading.Thread(target=self.read, args=[reading], daemon=True)
        self.reader.start()

    def read(self, reading):
        with open(reading, encoding="utf-8", errors="replace") as lines:
            for line in lines:
                with contextlib.suppress(ValueError):
                    self.events.put(json.loads(line))

    def next(self, wait_s):
        """An event; None where there is none in that time."""
        try:
            return self.events.get(timeout=wait_s)
        except queue.Empty:
            return None

    def ended(self):
        """Whether the process has ended, and all events are out."""
        if self.process.poll() is None:
            return False
        self.reader.join(LAST_S)
        return self.events.empty()

    def code(self):
        """The exit code, as a shell has it."""
        code = self.process.wait()
        return code if code >= 0 else 128 - code

    def handed_on(self):
        """`handed_on` of its process."""
        return handed_on(self.process)


@contextlib.contextmanager
def handed_on(process):
    """Who ends this process ends Snakemake: by SIGTERM, and by a fault of ours.

    Its jobs are ended, too: left to itself it would wait for them, an hour if need be.
    It is told once: its own handler waits for a lock, and the thread that it interrupts
    may hold it. If that has happened it is killed. Yields a `threading.Event`, set when
    somebody has asked for the end.
    """
    asked = threading.Event()

    def end(*_):
        if not asked.is_set():
            asked.set()
            process.terminate()
            last = threading.Timer(STUCK_S, end_at_last, [process])
            last.daemon = True
            last.start()
        end_jobs(process)

    main = threading.current_thread() is threading.main_thread()
    before = main and signal.signal(signal.SIGTERM, end)
    try:
        yield asked
    finally:
        while process.poll() is None:
            end()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(AGAIN_S)
        if main:
            signal.signal(signal.SIGTERM, before)


def end_at_last(process):
    """Kill what has not ended."""
    end_jobs(process)
    process.kill()


def end_jobs(process):
    """Ask all that a process has started to end, if it has not ended itself."""
    with contextlib.suppress(psutil.NoSuchProcess):
        for job in psutil.Process(process.pid).children(recursive=True):
            with contextlib.suppress(psutil.NoSuchProcess):
                job.terminate()
