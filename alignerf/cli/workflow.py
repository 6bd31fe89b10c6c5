"""A config's run, and what a user sees of it: by Snakemake, where something is trained.

A plugin of this project's (workflow/plugins) tells what Snakemake does; all that it and
its jobs print goes to a file, which is named. With VERBOSE in the environment (`make
run VERBOSE=1`) that is what a user sees.
"""

import contextlib
import importlib.util
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

from alignerf.cli import configs, light, report
from alignerf.experiment import asked, sources, targets
from alignerf.experiment.tables import shipped
from alignerf.io import owned, provenance

LOGS, KEPT = Path("results/logs"), 10
OURS = re.compile(r"run-\d{8}-\d{6}-\d+\.log")
PLUGIN, EVENTS = "alignerf-events", "ALIGNERF_EVENTS"
POLL_S = 0.1
NO_TRAINING = (
    "trainings want more packages than are installed: in the folder of this program's "
    "sources, pip install '.[train]'"
)
# A job that is begun meanwhile is asked to end too; Snakemake may take so long at most.
AGAIN_S, STUCK_S = 2.0, 30.0


def run(path, cores, *wanted, overrides=(), forced=(), first=()):
    """Run a config for targets, and show it; returns the exit code.

    path: None is the demo's config. overrides: `key=value` of top-level keys. forced:
    files that are made anew. first: files that come before all others, with what they
    need.
    """
    config = configs.read(path or shipped.DEMO)
    scenes = config["scenes"]
    captures = list(scenes)
    if path and light.takes(path):
        code = light.run(path, cores, wanted, overrides)
    elif importlib.util.find_spec("snakemake") is None:
        raise ValueError(NO_TRAINING)
    else:
        command = command_of(path, cores, wanted, overrides, forced, first)
        if provenance.is_verbose():
            return loud(command)
        code = quiet(command, captures)
    if code == 0 and (not wanted or "all" in wanted):
        exports = any(map(configs.can_export, scenes.values()))
        export = exports and targets.export_command([path] if path else [])
        printed = config.get("published_table") and asked.of_table(targets.COMPARISON)
        lines = [*(printed or ()), *targets.verdicts(captures, export=export)]
        print("\n".join(lines), flush=True)
    return code


def command_of(path, cores, wanted, overrides, forced, first=()):
    """Snakemake's words."""
    profile = sources.PIPELINE / "profiles" / "default"
    command = [sys.executable, "-m", "snakemake", "--cores", str(cores)]
    command += ["--snakefile", str(sources.PIPELINE / "Snakefile")]
    # Named, since a folder `default` of a user's comes before what is found by itself.
    command += ["--workflow-profile", str(profile)]
    command += ["--configfile", str(path)] if path else []
    command += ["--config", *overrides] if overrides else []
    command += ["--forcerun", *forced] if forced else []
    command += ["--prioritize", *first] if first else []
    return [*command, "--", *wanted]


def quiet(command, captures):
    """Run it with a line a job; returns the exit code."""
    log = log_file()
    told = report.Report(captures, log)
    told.line(f"all that Snakemake and its jobs say: {log}")
    command = [*command[:3], "--logger", PLUGIN, *command[3:]]
    # Snakemake takes a plugin that it finds on the search path.
    paths = [str(sources.PLUGINS), os.environ.get("PYTHONPATH", "")]
    path = os.pathsep.join(filter(None, paths))
    with tempfile.NamedTemporaryFile("r") as events, open(log, "wb") as output:
        code = ended(
            subprocess.Popen(
                command,
                env=os.environ | {EVENTS: events.name, "PYTHONPATH": path},
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            ),
            lambda: told.look(events),
            told.stop,
        )
        told.look(events)
    # Plans come before all else, and may be there already.
    if code or told.finished or Path(command[-1]).name != "preflight.json":
        told.close(code)
    return code


def loud(command):
    """Run it, and let Snakemake speak; returns the exit code."""

    def stopped():
        print("stopped; the same command goes on", file=sys.stderr)

    return ended(subprocess.Popen(command, start_new_session=True), stop=stopped)


def ended(process, look=lambda: None, stop=lambda: None):
    """Look at Snakemake until it ends; returns the exit code, as a shell has it.

    Who ends this process ends Snakemake and its jobs, as does a fault of `look`.
    Snakemake has a session of its own, so that it is told once: its handler waits for a
    lock, which the thread that a second signal interrupts may hold.
    """
    with light.interruptible() as asked:
        try:
            while process.poll() is None:
                look()
                time.sleep(POLL_S)
        except KeyboardInterrupt:
            stop()
        finally:
            for one in light.SIGNALS:
                signal.signal(one, signal.SIG_IGN)
            end(process)
    code = light.STOPPED if asked else process.returncode
    return code if code >= 0 else 128 - code


def end(process):
    """Ask a process and all that it has started to end; kill one that does not."""
    if process.poll() is None:
        process.terminate()
    begun_s = time.monotonic()
    while process.poll() is None:
        with contextlib.suppress(psutil.NoSuchProcess):
            for job in psutil.Process(process.pid).children(recursive=True):
                with contextlib.suppress(psutil.NoSuchProcess):
                    job.terminate()
        if time.monotonic() > begun_s + STUCK_S:
            process.kill()
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(AGAIN_S)


def log_file():
    """A new file for all that a run prints; of earlier ones the last few stay."""
    owned.check_links(LOGS)
    LOGS.mkdir(parents=True, exist_ok=True)
    ours = sorted(path for path in LOGS.iterdir() if OURS.fullmatch(path.name))
    for old in ours[: 1 - KEPT]:
        old.unlink(missing_ok=True)
    return LOGS / f"run-{time.strftime('%Y%m%d-%H%M%S')}-{os.getpid()}.log"
