"""The workflow on a config, as `make run` runs it on the default one."""

import contextlib
import os
import signal
import subprocess
import sys

from alignerf.experiment import sources


def run(path, cores, *targets, overrides=(), forced=()):
    """Run a config for targets; returns the exit code.

    overrides: `key=value` of top-level keys. forced: rules that run again.
    """
    profile = sources.ROOT / "workflow" / "profiles" / "default"
    command = [sys.executable, "-m", "snakemake", "--cores", str(cores)]
    command += ["--snakefile", str(sources.ROOT / "Snakefile")]
    command += ["--workflow-profile", str(profile), "--configfile", str(path)]
    command += ["--config", *overrides] if overrides else []
    command += ["--forcerun", *forced] if forced else []
    command += ["--", *targets]
    child = subprocess.Popen(command, env=os.environ)
    while True:
        # Ctrl-C reaches it too: it ends its jobs, and is waited for.
        with contextlib.suppress(KeyboardInterrupt):
            code = child.wait()
            break
    if code == -signal.SIGINT or code == 128 + signal.SIGINT:
        print("stopped; the same command goes on", file=sys.stderr)
    return code if code >= 0 else 128 - code
