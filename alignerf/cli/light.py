"""Judged scenes, and their exports, stage by stage in this process.

Nothing is trained there, so neither the workflow engine nor JAX is needed. Results are
as by workflow/rules, which can go on with them.
"""

import contextlib
import json
import logging
import os
import runpy
import signal
import sys
import tempfile
import traceback
import types
from pathlib import Path
from typing import NamedTuple

from alignerf.captures import base
from alignerf.cli import configs, report
from alignerf.experiment import check, cluster, layout, plan, sources, steps, targets
from alignerf.experiment.checks import results
from alignerf.io import atomic, json_files, machine, progress
from alignerf.scenes import originals

# Beside a scene's results: what each stage's outputs were made by.
MADE_BY = "made_by.json"
# By these a keyboard, another process and a terminal that is closed end a run.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Rules whose commands take `--threads`.
IN_THREADS = ("train", "render", "align", "overfit", "correct_poses", "decompose")
POLL_S = 0.1
# The exit code of a run that was ended by one.
STOPPED = 130


class Stage(NamedTuple):
    """A rule of workflow/rules, its wildcards, what it makes, and where it says so."""

    rule: str
    wildcards: dict
    log: str
    outputs: list


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
    cluster.link(experiment.scenes, layout.Scene("{scene}").config)
    sources.set_environment(targets.export_command([path]))
    results.check_writable(experiment.scenes, experiment.methods)
    exports = targets.exports(experiment) if wanted == ("export",) else []
    with interruptible() as asked, shown(experiment.captures()) as (told, tell):
        code, lines = make(experiment, exports, cores, forced, tell, asked)
        told.stopping = code == STOPPED
    told.close(code, [*lines, targets.GOES_ON] if lines else [])
    return code


def stages_of(experiment, scene, exports):
    """The stages of a judged scene, in turn; each reads what those before it made."""
    at, training = layout.Scene(scene), experiment.judged_folder(scene)
    of = {"scene": scene, "training": training.name}

    def stage(rule, *outputs, place=training, log=None, **more):
        return Stage(rule, of | more, place.log(log or rule), [*map(str, outputs)])

    yield stage("poses", at.images, at.cameras, at.poses, place=at)
    yield stage("train", training.timing, training.learnt)
    yield stage("render", training.renders, training.depth, training.render)
    yield stage("align", training.flow, training.warped, training.displacement)
    yield stage("overfit", training.overfit)
    if experiment.capture(scene).can_export(experiment.scenes[scene]):
        yield stage("correct_poses", training.corrected, training.corrections)
    for split in experiment.splits(scene, training.name):
        parts = training.parts(split, "_photos")
        stats, log = training.decomposition(split, "_photos"), f"_photos_{split}"
        more = {"log": f"decompose{log}", "split": split, "photos": "_photos"}
        yield stage("decompose", parts, stats, **more)
    yield stage("config", at.config, place=at)
    yield stage("verdict", at.verdict, at.views, place=at)
    yield stage("page", at.page, place=at)
    for path in (one for one in exports if Path(one).parts[1] == scene):
        method, _, what = Path(path).parts[2:]
        own = layout.Training(f"{at}/{method}")
        more = {"place": own, "log": f"export_{what}", "method": method, "what": what}
        yield stage("export_folder", path, **more)


def make(experiment, exports, cores, forced, tell, asked):
    """Run what is out of date: (exit code, last lines where a stage failed).

    asked: signals that have come, also where what they raised was not passed on.
    """
    rules, todo, noted = steps.Rules(experiment, lambda path: path), [], {}
    for scene in experiment.captures():
        file, fresh = Path(layout.Scene(scene), MADE_BY), True
        known, noted[scene] = json_files.read(file) if file.is_file() else {}, {}
        for stage in stages_of(experiment, scene, exports):
            wildcards = types.SimpleNamespace(**stage.wildcards)
            by = made_by(getattr(rules, stage.rule).make(wildcards))
            there = known.get(stage.outputs[0]) == by
            there &= all(map(os.path.exists, stage.outputs))
            there &= not {*forced} & {*stage.outputs}
            if stage.rule == "poses":
                there &= not originals.changed(Path(layout.Scene(scene)))
            # What follows a stage that is made anew is made anew, too.
            fresh &= there
            if fresh:
                noted[scene][stage.outputs[0]] = by
            else:
                todo.append((stage, by))
    # Outputs are replaced as they are written: a user's files among them stay.
    written = [path for stage, _ in todo for path in (*stage.outputs, stage.log)]
    results.claim(experiment.scenes, written=written)
    tell(event="run_info", total=len(todo))
    for number, (stage, by) in enumerate(todo):
        scene, told = stage.wildcards["scene"], {"rule_name": stage.rule}
        told |= {"wildcards": stage.wildcards, "output": stage.outputs}
        tell(event="job_info", jobid=number, log=[stage.log], **told)
        threads = ["--threads", str(cores)] * (stage.rule in IN_THREADS)
        code = ended([*by["command"], *threads], stage.log)
        if code := STOPPED if asked else code:
            tell(event="job_error", jobid=number)
            return code, [] if code == STOPPED else targets.cause(Path(stage.log))
        tell(event="job_finished", jobid=number)
        tell(event="progress", done=number + 1, total=len(todo))
        noted[scene][stage.outputs[0]] = by
        with atomic.replace_file(Path(layout.Scene(scene), MADE_BY)) as path:
            path.write_text(json.dumps(noted[scene], indent=1))
    return 0, []


def made_by(step):
    """What a stage is made by: its command, its code, and single files of a user's."""
    files = [path for path in step.own.values() if path and os.path.isfile(path)]
    return {
        "command": [*map(str, step.command)],
        "sources": sources.sources_of(*(step.modules or step.command[:1])),
        "files": {str(path): os.stat(path).st_mtime_ns for path in files},
    }


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
    told = report.Report(captures, None, sys.stdout)
    with tempfile.NamedTemporaryFile("r") as events, open(events.name, "a") as file:

        def tell(**event):
            print(json.dumps(event), file=file, flush=True)

        with progress.every(POLL_S, lambda: told.look(events)):
            yield told, tell
        told.look(events)
