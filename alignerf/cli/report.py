"""A run in a few lines: each job when it ends, and what stopped it if something did.

A terminal has a bar beneath them. Elsewhere its text is a line now and then, as logs
can have it.
"""

import json
import os
import re
import sys
import textwrap
import time
from pathlib import Path
from typing import NamedTuple

from rich import console
from rich import progress as bars

from alignerf.cli import configs
from alignerf.experiment import targets
from alignerf.io import faults, progress

# Rules whose own lines are shown, as a user decides by them.
TELLING = ("preflight",)
# Seconds between changes of the bar, and between such lines in a log; or so many times
# what they took to find.
EVERY_S, LOG_EVERY_S, TIMES = 1.0, 30.0, 20.0
# Lines of the log that are shown where no job has failed.
LAST_LINES = 40
NAME_WIDTH, WIDTH, BAR_WIDTH = 62, 94, 24
# Of one job.
MAX_WARNINGS = 5
# {} is the training, as `of_training` names it. Other rules have their own name.
NAMES = {
    "poses": "photos and cameras",
    "facts": "facts about the photos, settings that suit them",
    "config": "the complete config",
    "preflight": "what the run will cost",
    "preview": "what the run will cost",
    "train": "{}: training",
    "render": "{}: renders",
    "align": "{}: flow from renders to photos",
    "decompose": "{}: parts of the flow",
    "overfit": "{}: error of the flow estimator",
    "correct_poses": "{}: cameras corrected",
    "align_test_poses": "{}: cameras fitted to test photos",
    "evaluate": "{}: scores",
    "testset": "warped test photos",
    "control_sets": "controls of the warped test photos",
    "collect": "scores and costs",
    "tables": "table",
    "draw": "figures",
    "verdict": "verdict",
    "page": "page",
    "export_folder": "{}: files for other programs",
}
# What two jobs of one training differ in besides.
BESIDES = {"split": "{} photos", "what": "{}", "table": "{}"}
MOVED = "with moved cameras"
LAST_BYTES = 4000


class Running(NamedTuple):
    """A job under way; begun_s: by the monotonic clock."""

    rule: str
    name: str
    begun_s: float
    logs: list


class Report:
    """Takes events, and shows them.

    captures: scenes of the run. log: all its text, if it is in one file.
    """

    def __init__(self, captures, log, stream=None):
        # An editor's shell knows no control sequences.
        live = (stream or sys.stdout).isatty() and os.environ.get("TERM") != "dumb"
        self.console = console.Console(file=stream, force_terminal=live)
        self.bar = bars.Progress(
            bars.BarColumn(BAR_WIDTH),
            bars.TextColumn("{task.description}", markup=False),
            console=self.console,
            transient=True,
            auto_refresh=False,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self.whole = self.bar.add_task("", total=1.0)
        self.live, self.every_s = live, EVERY_S if live else LOG_EVERY_S
        self.captures, self.log = captures, log
        self.begun_s = time.monotonic()
        self.due_s = self.begun_s + self.every_s
        self.running, self.finished, self.warned = {}, 0, set()
        self.done, self.total, self.errors = 0, 0, []
        # Of a line that is not whole yet.
        self.rest = ""
        # A job that ends from then on was stopped.
        self.stopping = False

    def line(self, text):
        """A line that stays."""
        self.console.out(text, highlight=False)

    def look(self, events):
        """Show what Snakemake has told since, and how far it is; events: a file."""
        *lines, self.rest = (self.rest + events.read()).split("\n")
        for line in lines:
            self.take(json.loads(line))
        if self.total and (now_s := time.monotonic()) >= self.due_s:
            share, text = self.state()
            if self.live:
                self.bar.start()
                self.bar.update(self.whole, completed=share, description=text)
                self.bar.refresh()
            else:
                self.line(f"  ... {text}")
            took_s = time.monotonic() - now_s
            self.due_s = now_s + max(self.every_s, TIMES * took_s)

    def take(self, event):
        """Show an event, if a reader wants to know it."""
        kind = event["event"]
        if kind == "job_info" and event["output"]:
            of = (event["rule_name"], event["wildcards"], event["log"])
            self.begin(event["jobid"], *of)
        elif kind in ("job_finished", "job_error"):
            self.end(event["jobid"], failed=kind == "job_error")
        elif kind == "progress":
            self.done, self.total = event["done"], event["total"]
        elif kind == "run_info":
            self.total = event["total"]
        elif kind == "error":
            self.errors.append(event["text"])

    def begin(self, key, rule, wildcards, logs):
        """Show a job as running."""
        name = name_of(rule, wildcards, self.captures)
        self.running[key] = Running(rule, name, time.monotonic(), logs)

    def end(self, key, failed):
        """A line for a job that has ended, and what it tells. A target is no job."""
        if (job := self.running.pop(key, None)) is None:
            return
        self.finished += 1
        took = clock(time.monotonic() - job.begun_s)
        how = ("  stopped" if self.stopping else "  FAILED") if failed else ""
        self.line(f"  {job.name:<{NAME_WIDTH}} {took:>7}{how}")
        if job.rule in TELLING and not failed:
            self.tell(said(job.logs))
        new = [x for x in warnings(job.logs) if x not in self.warned]
        self.warned.update(new)
        self.tell(new[:MAX_WARNINGS])
        if (more := len(new) - MAX_WARNINGS) > 0:
            self.tell([f"and {more} more in {', '.join(job.logs)}"])

    def tell(self, lines):
        """Lines beneath a job's own."""
        for line in map(faults.one_line, lines):
            for part in textwrap.wrap(line, WIDTH, subsequent_indent="  "):
                self.line(f"      {part}")

    def state(self):
        """(share that is done, 'jobs done; jobs that run')."""
        # Of another thread's jobs, too.
        running = [*self.running.values()]
        shown = {job.name: last_shown(job.logs) for job in running}
        share = self.done / max(self.total, 1)
        text = f"{self.done} of {self.total} jobs"
        if len(shown) == 1 and (only := next(iter(shown.values()))) and only.left_s:
            text += f", {clock(only.left_s)} left of this one"
        names = [n + (f", {one.text}" if one else "") for n, one in shown.items()]
        return share, "; ".join([text, *names])

    def stop(self):
        """Say that the run is asked to end."""
        self.stopping = True
        self.line("stopping what runs")

    def close(self, code, faults=()):
        """The last lines; code: the run's exit code. faults: what stopped it."""
        if self.live:
            self.bar.stop()
        if code == 0:
            count = "1 job" if self.finished == 1 else f"{self.finished} jobs"
            took = clock(time.monotonic() - self.begun_s)
            there = "all of it is there already"
            self.line(f"{count} in {took}" if self.finished else there)
            return
        # Jobs that were asked to end are no faults.
        asked = [targets.AS_ASKED, targets.GOES_ON] if self.stopping else []
        for line in asked or faults or targets.causes([self.log]) or self.faults():
            self.line(line)
        if self.log:
            self.line(f"all that the run said: {self.log}")

    def faults(self):
        """What stopped a run that has no failed job, as a plan that is wrong."""
        text = self.log.read_text(encoding="utf-8", errors="replace")
        lines = text.rstrip().splitlines()
        if "LockException" in text:
            return f"error: {configs.LOCKED}", f"  {configs.unlocking()}"
        ours = [line for line in lines if line.startswith("error: ")]
        told = [line for error in self.errors for line in error.splitlines()]
        return ours or told or lines[-LAST_LINES:]


def clock(seconds):
    """'0:05', '12:30', '1:02:03'."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours}:{minutes:02d}:{seconds:02d}"
    return f"{minutes}:{seconds:02d}"


def name_of(rule, wildcards, captures):
    """'plain: training', after the scene's name where there are several.

    wildcards: {name: value} of the job. captures: scenes of the run.
    """
    parts = [NAMES.get(rule, rule.replace("_", " ")).format(of_training(wildcards))]
    for key, text in BESIDES.items():
        if wildcards.get(key):
            parts.append(text.format(wildcards[key]))
    if wildcards.get("moved"):
        parts.append(MOVED)
    scene = wildcards.get("scene")
    alone = scene is None or [scene] == list(captures)
    return ("" if alone else f"{scene}: ") + ", ".join(parts)


def of_training(wildcards):
    """'plain' of plain/round0, 'plain, round 1' of plain/round1."""
    name = wildcards.get("training") or wildcards.get("method") or "all"
    if "round" in wildcards and "training" not in wildcards:
        name += f"/round{wildcards['round']}"
    name = re.sub(r"/round(\d+)", r", round \1", name.replace("/round0", ""))
    return name.replace("/", " ")


def last_shown(logs):
    """The last `progress.Shown` of a job's logs; None where there is none."""
    for path in logs:
        lines = re.split(r"[\r\n]+", last_text(Path(path)).strip())
        if (shown := progress.read(lines[-1])) is not None:
            return shown
    return None


def last_text(path):
    """The end of a file; nothing where it cannot be read."""
    try:
        with open(path, "rb") as file:
            file.seek(max(0, os.fstat(file.fileno()).st_size - LAST_BYTES))
            return file.read().decode(errors="replace")
    except OSError:
        return ""


def said(logs):
    """Lines of a job's logs, without those of its progress."""
    found = []
    for path in logs:
        try:
            text = Path(path).read_text(encoding="utf-8", errors="replace")
        except OSError:
            continue
        lines = [line.split("\r")[-1].rstrip() for line in text.splitlines()]
        found += [line for line in lines if line and not progress.read(line)]
    return found


def warnings(logs):
    """The warnings among them, each once."""
    found = (line for line in said(logs) if line.startswith(faults.WARNING))
    return list(dict.fromkeys(found))
