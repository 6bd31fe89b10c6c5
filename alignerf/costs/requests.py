"""Memory and minutes that a job asks for, from its scene's preflight, where it is.

Functions here make resource functions of Snakemake. On one machine these limit nothing.
A job that was killed, by its limits or otherwise, asks for twice as much the next time.
"""

import functools
import math
from pathlib import Path

from alignerf.costs import plan, summary

# Where the preflight says nothing: of a scene of phone photos.
MEMORY_MB, MINUTES = 8000, 240
# Beside the process that was measured runs Snakemake itself; all grows a little. Nodes
# differ, and are shared.
MORE_MEMORY, SNAKEMAKE_MB, MORE_TIME, START_MIN = 1.25, 500, 2.0, 10
NOTHING = plan.Task("", "", 0.0)


def memory_mb(file):
    """The resource mem_mb of the job that makes an output below its scene's folder.

    file: with wildcards in braces, as `{training}/timing.json`.
    """

    def asked(wildcards, attempt):
        size = task_of(wildcards, file).peak_bytes
        needed = MORE_MEMORY * size / 1e6 + SNAKEMAKE_MB if size else MEMORY_MB
        return math.ceil(needed) * 2 ** (attempt - 1)

    return asked


def minutes(file):
    """The resource runtime, in minutes, of the same job."""

    def asked(wildcards, attempt):
        seconds = task_of(wildcards, file).seconds
        needed = MORE_TIME * seconds / 60 + START_MIN if seconds else MINUTES
        return math.ceil(needed) * 2 ** (attempt - 1)

    return asked


def usual_mb(wildcards, attempt):
    """The resource mem_mb of a job of which no preflight can tell."""
    return MEMORY_MB * 2 ** (attempt - 1)


def task_of(wildcards, file) -> plan.Task:
    """What the preflight says of the task with an output; NOTHING without it."""
    path = Path("results") / wildcards.scene / "preflight.json"
    if not path.is_file():
        return NOTHING
    return read(path, path.stat().st_mtime_ns).get(file.format(**wildcards), NOTHING)


@functools.lru_cache(maxsize=1024)
def read(path, written_ns):
    """{output: task} of a preflight.json; nothing of a damaged one: a plan goes on."""
    try:
        return {task.file: task for task in summary.read(path)["tasks"]}
    except (OSError, ValueError):
        return {}
