"""Judged scenes, and their exports, step by step in this process.

Nothing is trained there, so neither the workflow engine nor JAX is needed. Results are
as by workflow/rules, which can go on with them.
"""

import collections
import contextlib
import json
import logging
import os
import re
import runpy
import signal
import sys
import tempfile
import threading
import traceback
from pathlib import Path
from typing import NamedTuple

from alignerf.captures import base
from alignerf.cli import configs, report
from alignerf.experiment import check, cluster, layout, plan, sources, steps, targets
from alignerf.experiment.checks import results
from alignerf.io import atomic, json_files, machine

S, T = layout.Scene("{scene}"), layout.training("{scene}", "{training}")
PARTS = T.parts("{split}", "{photos}"), T.decomposition("{split}", "{photos}")
# {rule: (log, outputs, whether its command takes `--threads`)}, as in workflow/rules.
RULES = {
    "config": (S.log("config"), [S.config], False),
    "poses": (S.log("poses"), [S.images, S.cameras, S.poses], False),
    "train": (T.log("train"), [T.timing, T.learnt], True),
    "render": (T.log("render"), [T.renders, T.depth, T.render], True),
    "align": (T.log("align"), [T.flow, T.warped, T.displacement], True),
    "overfit": (T.log("overfit"), [T.overfit], True),
    "correct_poses": (T.log("correct_poses"), [T.corrected, T.corrections], True),
    "decompose": (T.log("decompose{photos}_{split}"), PARTS, True),
    "verdict": (S.log("verdict"), [S.verdict, S.views], False),
    "page": (S.log("page"), [S.page], False),
    "export_folder": (
        f"{S}/{{method}}/logs/export_{{what}}.log",
        [S.export("{method}", "{what}")],
        False,
    ),
}
LETTERS = {"training": r"[^/]+/round\d+", "split": "train|test", "photos": "|_photos"}
LETTERS |= {"what": "cameras|photos"}
# Beside a scene's results: what each job's outputs were made by, and when.
MADE_BY = "made_by.json"
# By these a keyboard, another process and a terminal that is closed end a run.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
POLL_S = 0.1
# The exit code of a run that was ended by one.
STOPPED = 130


class Job(NamedTuple):
    """A rule, its wildcards, what it runs and makes. sources: of its code."""

    rule: str
    wildcards: NamedTuple
    command: list
    threads: list
    sources: str
    inputs: list
    outputs: list
    log: str

    def state(self):
        """What it is made by, and the times of its files; None of a missing one."""
        times = {}
        for path in (*self.inputs, *self.outputs):
            exists = os.path.exists(path)
            times[str(path)] = os.stat(path).st_mtime_ns if exists else None
        return {"command": self.command, "sources": self.sources, "times": times}


def takes(path):
    """Whether a config has judged scenes alone."""
    scenes = configs.read(path)["scenes"].values()
    named = [one.get("source") for one in scenes if isinstance(one, dict)]
    records = [base.every().get(name) for name in named if isinstance(name, str)]
    judged = [one for one in records if one is not None and not one.trains]
    return len(judged) == len(scenes)


def run(path, cores, wanted, overrides=(), forced=()):
    """Make what is missing or out of date; the exit code. Arguments: `workflow.run`."""
    machine.limit(cores)
    config = configs.read(path)
    for key, _, value in (one.partition("=") for one in overrides):
        config[key] = int(value)
    experiment = plan.Experiment(check.checked(config, [path]))
    plan.check_equal(experiment)
    results.check_folders(experiment.scenes, experiment.methods)
    cluster.link(experiment.scenes, S.config)
    sources.set_environment(targets.export_command([path]))
    results.check_writable(experiment.scenes, experiment.methods)
    found = jobs_of(experiment, wanted_of(experiment, wanted), cores)
    with interruptible() as asked, shown(experiment.captures()) as (told, tell):
        code, lines = make(experiment.scenes, found, forced, tell, asked)
        told.stopping = code == STOPPED
    told.close(code, [*lines, targets.GOES_ON] if lines else [])
    return code


def wanted_of(experiment, wanted):
    """The files behind `all` and `export`."""
    if wanted == ("export",):
        return targets.exports(experiment)
    of_scenes = [targets.of_scene(experiment, name) for name in experiment.captures()]
    return [path for paths in of_scenes for path in paths]


def jobs_of(experiment, wanted, cores):
    """The jobs that lead to files, in an order in which they can run."""
    rules = steps.Rules(experiment, lambda path: path)
    letters = LETTERS | {"scene": plan.one_of(experiment.scenes), "method": "[^/]+"}
    found = {}

    def go(path):
        rule, wildcards = made_by(path, letters)
        if rule is None or (rule, wildcards) in found:
            return
        (log, outputs, threads), asked = RULES[rule], getattr(rules, rule)
        inputs = [*flat(asked.inputs(wildcards).values())]
        for one in inputs:
            go(one)
        log, *made = (one.format(**wildcards._asdict()) for one in (log, *outputs))
        words = [str(word) for word in asked.command(wildcards)]
        runs = words, ["--threads", str(cores)] * threads, asked.sources(wildcards)
        found[rule, wildcards] = Job(rule, wildcards, *runs, inputs, made, log)

    for path in wanted:
        go(path)
    return list(found.values())


def made_by(path, letters):
    """(rule, wildcards) that a file is made by; None of a user's.

    letters: {wildcard: what it may be}.
    """
    groups = {name: f"(?P<{name}>{letter})" for name, letter in letters.items()}
    for rule, (_, outputs, _) in RULES.items():
        for pattern in outputs:
            if found := re.fullmatch(pattern.format(**groups), path):
                names = found.groupdict()
                return rule, collections.namedtuple(rule, names)(**names)
    return None, None


def flat(paths):
    """The paths of texts, lists and mappings."""
    for one in paths:
        if isinstance(one, str | Path):
            yield str(one)
        else:
            yield from flat(one.values() if isinstance(one, dict) else one)


def make(scenes, found, forced, tell, asked):
    """Run the jobs that are out of date: (exit code, last lines where one failed).

    asked: signals that have come, also where what they raised was not passed on.
    """
    files = {scene: Path(layout.Scene(scene), MADE_BY) for scene in scenes}
    noted = {s: json_files.read(f) if f.is_file() else {} for s, f in files.items()}
    stale, anew = [], set(forced)
    for job in found:
        as_noted = noted[job.wildcards.scene].get(job.outputs[0]) == job.state()
        if not as_noted or anew & {*job.inputs, *job.outputs}:
            stale.append(job)
            anew |= set(job.outputs)
    # Outputs are replaced as they are written: a user's files among them stay.
    results.claim(scenes, written=[p for j in stale for p in (*j.outputs, j.log)])
    tell(event="run_info", total=len(stale), scenes="\n".join(scenes))
    for number, job in enumerate(stale):
        scene, told = job.wildcards.scene, {"jobid": number, "rule_name": job.rule}
        told |= {"wildcards": job.wildcards._asdict(), "output": job.outputs}
        tell(event="job_info", log=[job.log], **told)
        code = ended([*job.command, *job.threads], job.log)
        if code := STOPPED if asked else code:
            tell(event="job_error", jobid=number)
            return code, [] if code == STOPPED else targets.cause(Path(job.log))
        tell(event="job_finished", jobid=number)
        tell(event="progress", done=number + 1, total=len(stale))
        noted[scene][job.outputs[0]] = job.state()
        with atomic.replace_file(files[scene]) as path:
            path.write_text(json.dumps(noted[scene], indent=1))
    return 0, []


def ended(command, log):
    """Run a module as `python -m` does, all that it says in a log; the exit code."""
    shows = contextlib.nullcontext() if os.environ.get("VERBOSE") else into(log)
    before = sys.argv
    try:
        sys.argv = command
        with shows:
            return code_of(command[0])
    finally:
        sys.argv = before


def code_of(module):
    try:
        runpy.run_module(module, run_name="__main__", alter_sys=True)
    except SystemExit as end:
        if isinstance(end.code, str):
            print(end.code, file=sys.stderr)
            return 1
        return end.code or 0
    except KeyboardInterrupt:
        return STOPPED
    # A fault of the program, whose last line is shown.
    except Exception:
        traceback.print_exc()
        return 1
    return 0


@contextlib.contextmanager
def into(log):
    """All that is printed goes into a file, also what libraries in C say."""
    Path(log).parent.mkdir(parents=True, exist_ok=True)
    kept, handlers = os.dup(2), logging.root.handlers
    with open(log, "w", buffering=1, encoding="utf-8", errors="replace") as file:
        try:
            os.dup2(file.fileno(), 2)
            # Each command has its own.
            logging.root.handlers = []
            with contextlib.redirect_stdout(file), contextlib.redirect_stderr(file):
                yield
        finally:
            logging.root.handlers = handlers
            os.dup2(kept, 2)
            os.close(kept)


@contextlib.contextmanager
def interruptible():
    """Each of SIGNALS raises KeyboardInterrupt, but where it is ignored.

    Yields a list of those that have come.
    """
    asked = []

    def stop(number, _):
        asked.append(number)
        raise KeyboardInterrupt

    before = {one: signal.getsignal(one) for one in SIGNALS}
    asking = [one for one, handler in before.items() if handler != signal.SIG_IGN]
    try:
        for one in asking:
            signal.signal(one, stop)
        yield asked
    finally:
        for one in asking:
            signal.signal(one, before[one])


@contextlib.contextmanager
def shown(captures):
    """(a report that a thread keeps up to date, the function that tells it events)."""
    told, done = report.Report(captures, None, sys.stdout), threading.Event()
    with tempfile.NamedTemporaryFile("r") as events, open(events.name, "a") as file:

        def tell(**event):
            print(json.dumps(event), file=file, flush=True)

        def show():
            while not done.wait(POLL_S):
                told.look(events)

        thread = threading.Thread(target=show, daemon=True)
        thread.start()
        try:
            yield told, tell
        finally:
            done.set()
            thread.join()
            told.look(events)
