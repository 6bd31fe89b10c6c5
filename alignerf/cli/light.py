"""Judged scenes, and their exports, stage by stage in this process.

Nothing is trained there, so neither the workflow engine nor JAX is needed. Results are
as by workflow/rules, which can go on with them.
"""

import contextlib
import hashlib
import io
import json
import logging
import os
import runpy
import signal
import sys
import traceback
import types
from pathlib import Path

from alignerf.captures import base
from alignerf.cli import configs, report
from alignerf.experiment import check, cluster, layout, plan, sources, steps, targets
from alignerf.experiment.checks import results
from alignerf.io import atomic, json_files, machine, progress, provenance
from alignerf.judged import originals, views

# By these a keyboard, another process and a terminal that is closed end a run.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
# Rules whose commands take `--threads`.
IN_THREADS = ("train", "render", "align", "overfit", "correct_poses", "decompose")
POLL_S = 0.1
# The exit code of a run that was ended by one.
STOPPED = 130


def takes(path):
    """Whether a config has judged scenes alone."""
    scenes = configs.read(path)["scenes"].values()
    named = [str(one.get("source")) if isinstance(one, dict) else "" for one in scenes]
    return not any(getattr(base.every().get(one), "trains", True) for one in named)


def run(path, cores, wanted, overrides=()):
    """Make what is missing or out of date; the exit code. Arguments: `workflow.run`."""
    machine.limit(cores)
    config = configs.read(path)
    config |= {key: int(value) for key, value in (one.split("=") for one in overrides)}
    experiment = plan.Experiment(check.checked(config, [path]))
    plan.check_equal(experiment)
    results.check_folders(experiment.scenes, experiment.methods)
    cluster.link(experiment.scenes, layout.Scene("{scene}").config)
    sources.set_environment(targets.export_command([path]))
    results.check_writable(experiment.scenes, experiment.methods)
    exports = targets.exports(experiment) if wanted == ("export",) else []
    scenes, number = experiment.captures(), 0
    todo = [one for scene in scenes for one in stale(experiment, scene, exports)]
    # Outputs are replaced as they are written: a user's files among them stay.
    written = [file for _, _, log, *_, outputs in todo for file in (*outputs, log)]
    results.claim(experiment.scenes, written=written)
    told, code, lines = report.Report(scenes, None, sys.stdout), 0, []
    told.total = len(todo)
    shown = progress.every(POLL_S, lambda: told.look(io.StringIO()))
    with interruptible() as asked, shown:
        try:
            for number, (rule, of, log, command, known, _) in enumerate(todo):
                told.begin(number, rule, of, [log])
                threads = ["--threads", str(cores)] * (rule in IN_THREADS)
                code = called([*command, *threads], log)
                if provenance.is_verbose():
                    told.tell(report.said([log]))
                # What a signal has raised may not have been passed on.
                if asked:
                    raise KeyboardInterrupt
                if code:
                    lines = [*targets.cause(Path(log)), targets.GOES_ON]
                    break
                with atomic.replace_file(made_by(of["scene"])) as file:
                    file.write_text(json.dumps(known, indent=1))
                told.end(number, failed=False)
                told.done += 1
        except KeyboardInterrupt:
            code, told.stopping = STOPPED, True
        told.end(number, failed=True)
    told.close(code, lines)
    return code


def stale(experiment, scene, exports):
    """What is missing, or of other files, commands or code, and all stages after it.

    Rule, wildcards, log, command, {output: digest} of all until then, outputs.
    """
    file, rules = made_by(scene), steps.Rules(experiment, str)
    known = json_files.read(file) if file.is_file() else {}
    digest, made, found = opened(experiment.scenes[scene], file.parent), {}, []
    for rule, of, log, outputs in stages(experiment, scene, exports):
        step = getattr(rules, rule).make(types.SimpleNamespace(**of))
        code = sources.sources_of(*step.modules)
        command = [*map(str, step.command)]
        # Of single files that a stage reads besides, as results to compare with.
        own = originals.digest(file.parent, filter(None, step.own.values()))
        text = json.dumps([digest, code, command, own])
        digest = hashlib.sha256(text.encode()).hexdigest()
        made = made | {outputs[0]: digest}
        same = known.get(outputs[0]) == digest and all(map(os.path.exists, outputs))
        if found or not same:
            found.append((rule, of, log, command, made, outputs))
    return found


def made_by(scene):
    """The file that says of a scene's stages what their outputs were made by."""
    return Path(layout.Scene(scene), "made_by.json")


def opened(scene, place):
    """A digest of all files that a scene is read from; place: its results."""
    keys = scene.external_renders
    # The first stage says what is to be said of them.
    logging.disable()
    try:
        return originals.digest(place, views.files_of(views.find(scene), keys))
    finally:
        logging.disable(logging.NOTSET)


def stages(experiment, scene, exports):
    """(rule of workflow/rules, its wildcards, its log, its outputs) in turn."""
    at, own = layout.Scene(scene), experiment.judged_folder(scene)

    def stage(rule, *outputs, place=own, log=None, **more):
        of = {"scene": scene, "training": own.name} | more
        return rule, of, place.log(log or rule), [*map(str, outputs)]

    yield stage("poses", at.images, at.cameras, at.poses, place=at)
    yield stage("train", own.timing, own.learnt)
    yield stage("render", own.renders, own.depth, own.render)
    yield stage("align", own.flow, own.warped, own.displacement)
    yield stage("overfit", own.overfit)
    if experiment.capture(scene).can_export(experiment.scenes[scene]):
        yield stage("correct_poses", own.corrected, own.corrections)
    for split in experiment.splits(scene, own.name):
        of, log = {"split": split, "photos": "_photos"}, f"decompose_photos_{split}"
        outputs = own.parts(split, "_photos"), own.decomposition(split, "_photos")
        yield stage("decompose", *outputs, log=log, **of)
    yield stage("config", at.config, place=at)
    yield stage("verdict", at.verdict, at.views, at.transients, place=at)
    yield stage("page", at.page, place=at)
    for path in exports:
        _, name, method, _, what = Path(path).parts
        if name == scene:
            more = {"place": layout.Training(f"{at}/{method}"), "log": f"export_{what}"}
            yield stage("export_folder", path, **more, method=method, what=what)


def called(command, log):
    """Run a module as `python -m` does; the exit code.

    All that it says goes into the log, also what libraries in C say.
    """
    Path(log).parent.mkdir(parents=True, exist_ok=True)
    kept, before = os.dup(2), (sys.argv, logging.root.handlers)
    with (
        open(log, "w", buffering=1, encoding="utf-8", errors="replace") as file,
        contextlib.redirect_stdout(file),
        contextlib.redirect_stderr(file),
    ):
        try:
            os.dup2(file.fileno(), 2)
            # Each command has its own handlers.
            sys.argv, logging.root.handlers = command, []
            runpy.run_module(command[0], run_name="__main__", alter_sys=True)
        except SystemExit as end:
            return end.code or 0
        # A fault of the program, whose last line is shown.
        except Exception:
            traceback.print_exc()
            return 1
        finally:
            sys.argv, logging.root.handlers = before
            os.dup2(kept, 2)
            os.close(kept)
    return 0


@contextlib.contextmanager
def interruptible():
    """Each of SIGNALS raises KeyboardInterrupt, but where it is ignored.

    Yields a list of those that have come.
    """
    asked, before = [], {one: signal.getsignal(one) for one in SIGNALS}
    before = {one: own for one, own in before.items() if own != signal.SIG_IGN}

    def stop(number, _):
        asked.append(number)
        raise KeyboardInterrupt

    try:
        for one in before:
            signal.signal(one, stop)
        yield asked
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
