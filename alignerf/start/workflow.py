"""The workflow on a config, and what a user sees of it.

With VERBOSE in the environment (`make run VERBOSE=1`) that is all that Snakemake and
its jobs print.
"""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

from alignerf.experiment import sources, targets
from alignerf.files import yaml_files
from alignerf.start.terminal import events, report, screen

LOGS, KEPT = Path("results/logs"), 10
OURS = re.compile(r"run-\d{8}-\d{6}-\d+\.log")
# Targets after which nobody waits for a verdict.
WITHOUT_VERDICT = {("export",)}


def run(path, cores, *wanted, overrides=(), forced=(), first=()):
    """Run a config for targets, and show it; returns the exit code.

    path: None is the demo's config. overrides: `key=value` of top-level keys. forced:
    files that are made anew. first: files that come before all others, with what they
    need.
    """
    command = command_of(path, cores, wanted, overrides, forced, first)
    if os.environ.get("VERBOSE"):
        return loud(command)
    captures = scenes_of(path or targets.DEMO)
    code = quiet(command, captures)
    if code == 0 and wanted not in WITHOUT_VERDICT:
        export = targets.export_command([path] if path else [])
        print("\n".join(targets.verdicts(captures, export=export)), flush=True)
    return code


def command_of(path, cores, wanted, overrides, forced, first=()):
    """Snakemake's words."""
    profile = sources.PIPELINE / "workflow" / "profiles" / "default"
    command = [sys.executable, "-m", "snakemake", "--cores", str(cores)]
    command += ["--snakefile", str(sources.PIPELINE / "Snakefile")]
    command += ["--workflow-profile", str(profile)]
    command += ["--configfile", str(path)] if path else []
    command += ["--config", *overrides] if overrides else []
    command += ["--forcerun", *forced] if forced else []
    command += ["--prioritize", *first] if first else []
    return [*command, "--", *wanted]


def quiet(command, captures):
    """Run it with a line a job; returns the exit code."""
    log = log_file()
    shown = screen.Screen()
    shown.line(f"all that Snakemake and its jobs say: {log}")
    told = report.Report(shown, captures, log)
    child = events.Child([*command[:3], "--logger", events.PLUGIN, *command[3:]], log)
    with child.handed_on() as asked:
        while not child.ended():
            if asked.is_set() and not told.stopping:
                told.stopping = True
                shown.line("stopping what runs")
            # Ctrl-C reaches Snakemake too: it ends its jobs, and is waited for.
            try:
                if (event := child.next(screen.EVERY_S)) is not None:
                    told.take(event)
                told.tick()
            except KeyboardInterrupt:
                told.stopping = True
                shown.line("stopping what runs")
    code = child.code()
    told.close(code)
    return code


def loud(command):
    """Run it, and let Snakemake speak; returns the exit code."""
    child = subprocess.Popen(command, env=os.environ)
    with events.handed_on(child) as asked:
        code = None
        while code is None:
            with contextlib.suppress(KeyboardInterrupt):
                code = child.wait()
    if asked.is_set() or code in (-signal.SIGINT, 128 + signal.SIGINT):
        print("stopped; the same command goes on", file=sys.stderr)
    return code if code >= 0 else 128 - code


def log_file():
    """A new file for all that a run prints; of earlier ones the last few stay."""
    LOGS.mkdir(parents=True, exist_ok=True)
    ours = sorted(path for path in LOGS.iterdir() if OURS.fullmatch(path.name))
    for old in ours[: 1 - KEPT]:
        old.unlink(missing_ok=True)
    return LOGS / f"run-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.log"


def scenes_of(path):
    """Names of a config's scenes, as far as they can be told."""
    content = yaml_files.read(path)
    scenes = content.get("scenes") if isinstance(content, dict) else None
    return list(scenes) if isinstance(scenes, dict) else []
