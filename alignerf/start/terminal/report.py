"""A run in a few lines: each job when it ends, and what stopped it if something did."""

import functools
import math
import os
import shlex
import textwrap
import time
from pathlib import Path
from typing import NamedTuple

from alignerf.costs import summary
from alignerf.experiment import sources, targets
from alignerf.files import faults
from alignerf.start.terminal import jobs, screen

# Rules whose own lines are shown, as a user decides by them.
TELLING = ("preflight",)
# Of a job without a share of its own: the rest is for what takes longer than planned.
MOST_BY_CLOCK = 0.95
# The plans are asked again after so many seconds.
ASK_EVERY_S = 5.0
# Lines of the log that are shown where no job has failed.
LAST_LINES = 40
LOCKED = "another run is at work in this folder, or one was killed. Then type:"
NAME_WIDTH, WIDTH = 62, 94
# Of one job.
MOST_WARNINGS = 5
# What is left of a plan is not known to so many seconds.
SOON_S = 5


class Running(NamedTuple):
    """A job under way; begun_s: by the monotonic clock."""

    rule: str
    name: str
    begun_s: float
    outputs: list
    logs: list
    # The scene's target, and the like: it runs nothing.
    silent: bool


class Report:
    """Takes events, and shows them. captures: scenes of the run. log: all its text."""

    def __init__(self, shown: screen.Screen, captures, log, results="results"):
        self.screen, self.captures, self.log = shown, captures, log
        self.results = Path(results)
        self.begun_s = time.monotonic()
        self.running, self.finished = {}, 0
        self.done, self.total, self.plans = 0, 0, ""
        self.warned, self.errors = set(), []
        # A job that ends from then on was stopped.
        self.stopping = False
        self.left, self.ask_s = None, 0.0

    def take(self, event):
        """Show an event, if a reader wants to know it."""
        kind = event.get("event")
        if kind == "job_info":
            self.running[event.get("jobid")] = self.job(event)
        elif kind == "job_finished":
            self.end(event.get("job_id"))
        elif kind == "job_error":
            self.end(event.get("jobid"), failed=True)
        elif kind == "error" or event.get("level") == "ERROR":
            self.errors.append(event.get("text", ""))
        elif kind == "progress":
            self.done, self.total = event["done"], event["total"]
        elif kind == "run_info":
            self.total, self.plans = event.get("total", 0), event.get("scenes", "")

    def job(self, event):
        rule, outputs = event.get("rule_name", ""), event.get("output", [])
        name = jobs.name_of(rule, event.get("wildcards", {}), self.captures)
        logs = event.get("log", [])
        return Running(rule, name, time.monotonic(), outputs, logs, not outputs)

    def end(self, key, failed=False):
        """A line for a job that has ended, and what it tells."""
        if (job := self.running.pop(key, None)) is None or job.silent:
            return
        self.finished += 1
        took = screen.clock(time.monotonic() - job.begun_s)
        how = ("  stopped" if self.stopping else "  FAILED") if failed else ""
        self.screen.line(f"  {job.name:<{NAME_WIDTH}} {took:>7}{how}")
        if job.rule in TELLING and not failed:
            self.tell(jobs.said(job.logs))
        self.warn(job)

    def warn(self, job):
        """Show what a job warns of, if no job before it has."""
        new = [x for x in jobs.warnings(job.logs) if x not in self.warned]
        self.warned.update(new)
        self.tell(new[:MOST_WARNINGS])
        if (more := len(new) - MOST_WARNINGS) > 0:
            self.tell([f"and {more} more in {', '.join(job.logs)}"])

    def tell(self, lines):
        """Lines beneath a job's own."""
        for line in map(faults.one_line, lines):
            for part in textwrap.wrap(line, WIDTH, subsequent_indent="  "):
                self.screen.line(f"      {part}")

    def tick(self):
        """Show how far the run is, where it is time."""
        if self.total and self.screen.due():
            share, text = self.state()
            self.screen.state(share, text)

    def state(self):
        """(share that is done, 'jobs done, time left; what runs')."""
        now = [job for job in self.running.values() if not job.silent]
        shown = {job.name: jobs.last_shown(job.logs) for job in now}
        share = self.done / max(self.total, 1)
        text = f"{self.done} of {self.total} jobs"
        if (left := self.time_left(shown)) is not None:
            left_s, whole_s = left
            share = 1 - left_s / max(whole_s, left_s, 1.0)
            about = f"about {summary.minutes(left_s)} left"
            text += f", {about if left_s > SOON_S else 'nearly done'}"
        elif len(now) == 1 and (only := shown[now[0].name]) and only.left_s is not None:
            text += f", {screen.clock(only.left_s)} left of this one"
        names = [n + (f", {one.text}" if one else "") for n, one in shown.items()]
        return share, "; ".join([text, *names])

    def time_left(self, shown):
        """(seconds left, of how many) by the scenes' plans; None where there are none.

        shown: {name of a running job: `progress.Shown`, or None}.
        """
        now_s = time.monotonic()
        if now_s >= self.ask_s:
            share_of = functools.partial(self.share, shown)
            scenes = self.plans.split("\n")
            left = summary.seconds_left(self.results, scenes, share_of)
            self.left = left and (*left, now_s)
            self.ask_s = now_s + ASK_EVERY_S
        if self.left is None:
            return None
        left_s, whole_s, asked_s = self.left
        return max(0.0, left_s - (now_s - asked_s)), whole_s

    def share(self, shown, path, task):
        """The share of a task that a running job has done; None where none runs."""
        # Of windows, files lie beside the scene's folder.
        path = Path(os.path.normpath(path))
        for job in self.running.values():
            if not {Path(output) for output in job.outputs} & {path, *path.parents}:
                continue
            one = shown.get(job.name)
            if one and one.share is not None:
                return one.share
            by_clock = (time.monotonic() - job.begun_s) / max(task.seconds, math.ulp(1))
            return min(by_clock, MOST_BY_CLOCK)
        return None

    def close(self, code):
        """The last lines; code: the run's exit code."""
        self.screen.close()
        took = screen.clock(time.monotonic() - self.begun_s)
        if code == 0:
            count = "1 job" if self.finished == 1 else f"{self.finished} jobs"
            there = "all of it is there already"
            self.screen.line(f"{count} in {took}" if self.finished else there)
            return
        # Jobs that were asked to end are no faults.
        asked = [targets.AS_ASKED, targets.GOES_ON] if self.stopping else []
        for line in asked or targets.causes([self.log]) or self.faults():
            self.screen.line(line)
        self.screen.line(f"all that the run said: {self.log}")

    def faults(self):
        """What stopped a run that has no failed job, as a plan that is wrong."""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        lines = text.rstrip().splitlines()
        if "LockException" in text:
            return f"error: {LOCKED}", f"  {unlocking()}"
        if ours := [line for line in lines if line.startswith("error: ")]:
            return ours
        if told := [line for error in self.errors for line in error.splitlines()]:
            return told
        return lines[-LAST_LINES:]


def unlocking():
    """The command that takes Snakemake's lock of this folder away."""
    words = ["snakemake", "--unlock"]
    if Path.cwd() != sources.PIPELINE:
        words += ["--snakefile", str(sources.PIPELINE / "Snakefile")]
    return shlex.join(words)
