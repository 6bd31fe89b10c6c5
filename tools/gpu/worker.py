"""A process that runs functions in turn, and is ended where one takes too long."""

import concurrent.futures
import contextlib
import multiprocessing
import os
import signal
import sys
import threading

# A process that has not begun by then is none.
BEGINNING_S = 60


class Worker:
    """A process that runs stages in turn; it ends with one that takes too long.

    log: file that takes all that it prints.
    """

    def __init__(self, log):
        self.log, self.pool = log, None

    def run(self, stage, *, limit_s):
        """(state, note) of a stage."""
        if not self.pool:
            spawn = multiprocessing.get_context("spawn")
            self.pool = concurrent.futures.ProcessPoolExecutor(
                1, mp_context=spawn, initializer=begin, initargs=(self.log,)
            )
            self.pid = self.pool.submit(os.getpid)
        future = self.pool.submit(stage.function, *stage.arguments, **stage.options)
        try:
            return "done", future.result(limit_s) or ""
        except concurrent.futures.TimeoutError:
            self.end()
            return "stopped", f"after {limit_s:.0f} s"
        except Exception as error:
            # Whatever it was: the next stage may well run.
            if isinstance(error, concurrent.futures.BrokenExecutor):
                self.end()
            return "failed", f"{type(error).__name__}: {error}".splitlines()[0][:200]

    def end(self):
        """End the process, and what it has started."""
        pool, self.pool = self.pool, None
        if pool:
            # One that is only about to begin is in no group of its own yet.
            gone = ProcessLookupError, concurrent.futures.BrokenExecutor, TimeoutError
            with contextlib.suppress(*gone):
                os.killpg(self.pid.result(BEGINNING_S), signal.SIGKILL)
            pool.shutdown(wait=False, cancel_futures=True)


def begin(log):
    """In a worker: a process group of its own, and all that is printed into a file.

    Where its parent is gone, as by a kill, it goes as well: the next run has the device
    to itself.
    """
    os.setpgrp()
    threading.Thread(target=follow, daemon=True).start()
    with open(log, "a") as file:
        for stream in (sys.stdout, sys.stderr):
            os.dup2(file.fileno(), stream.fileno())


def follow():
    """Wait for the parent's end, then end the group."""
    multiprocessing.parent_process().join()
    os.killpg(0, signal.SIGKILL)
