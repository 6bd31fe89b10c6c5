"""What a command may write: nothing where another run is at work, or a user's files."""

import contextlib
import copy
import fcntl
import os
from pathlib import Path

from alignerf.experiment import check
from alignerf.experiment.checks import results
from alignerf.start.terminal import report

# The workflow engine's folder.
ENGINE = Path(".snakemake")


@contextlib.contextmanager
def held(*names):
    """Keep results/NAME, of each, to this process, as of `one_held`."""
    with contextlib.ExitStack() as stack:
        for name in sorted(set(names)):
            stack.enter_context(one_held(name))
        yield


@contextlib.contextmanager
def one_held(name):
    """Keep results/NAME to this process; ValueError where a run is at work there.

    The lock ends with the process, also where that is killed. Snakemake's own is looked
    at too: a run may have been begun by it, or have left it.
    """
    ENGINE.mkdir(exist_ok=True)
    path = ENGINE / f"{name}.held"
    with open(path, "w", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # A run that ends just now removes its file.
            if not os.path.samestat(os.stat(path), os.fstat(file.fileno())):
                raise FileNotFoundError(path)
        except OSError:
            raise ValueError(f"results/{name}: another run is at work there") from None
        try:
            if is_locked(name):
                raise ValueError(f"{report.LOCKED} {report.unlocking()}")
            yield
        finally:
            # Of a run that was refused nothing is left.
            path.unlink(missing_ok=True)
            with contextlib.suppress(OSError):
                ENGINE.rmdir()


def is_locked(name):
    """Whether Snakemake's lock is on files of results/NAME."""
    begins = f"results/{name}/"
    return any(
        line.startswith(begins)
        for path in (ENGINE / "locks").glob("*.output.lock")
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines()
    )


def check_free(config):
    """ValueError where a config has a fault, or its run would touch a user's files."""
    complete = check.checked(copy.deepcopy(config))
    results.check_folders(complete["scenes"], complete["methods"])
