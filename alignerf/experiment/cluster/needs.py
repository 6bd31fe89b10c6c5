"""Memory and minutes that a job asks for, from its scene's preflight.

Functions here make resource functions of Snakemake. On one machine these limit nothing.
A job that was killed, by its limits or otherwise, asks for twice as much the next time.
"""

import functools
import json
import math
from pathlib import Path

# Where the preflight says nothing: of a scene of phone photos.
MEMORY_MB, MINUTES = 8000, 240
# Beside the process that was measured runs Snakemake itself; all grows a little.
MORE_MEMORY, SNAKEMAKE_MB = 1.25, 500
# Nodes differ, and are shared.
MORE_TIME, START_MIN = 2.0, 10


def memory_mb(file):
    """The resource mem_mb of the job that ends with a file below its scene's folder.

    file: with wildcards in braces, as `{method}/round{round}/timing.json`.
    """

    def of(wildcards, attempt):
        task = task_of(wildcards, file)
        needed = task.get("peak_bytes", 0) / 1e6
        needed = MORE_MEMORY * needed + SNAKEMAKE_MB if needed else MEMORY_MB
        return math.ceil(needed) * 2 ** (attempt - 1)

    return of


def minutes(file):
    """The resource runtime, in minutes, of the same job."""

    def of(wildcards, attempt):
        seconds = task_of(wildcards, file).get("seconds")
        needed = MORE_TIME * seconds / 60 + START_MIN if seconds else MINUTES
        return math.ceil(needed) * 2 ** (attempt - 1)

    return of


def task_of(wildcards, file) -> dict:
    """What the preflight says of the task that ends with a file; nothing without it."""
    path = Path("results") / wildcards.scene / "preflight.json"
    try:
        written_ns = path.stat().st_mtime_ns
        return tasks_in(path, written_ns).get(file.format(**wildcards), {})
    # No preflight yet; or a point of the sweep, of which it knows nothing.
    except (OSError, KeyError):
        return {}


@functools.lru_cache(maxsize=1024)
def tasks_in(path, written_ns) -> dict:
    """{file: task} of a preflight.json as it was then; none where it is no such file.

    A plan must not end by it: the preflight itself says what is wrong with it.
    """
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        tasks = {task["file"]: task for task in found.get("tasks", [])}
        # Numbers that can be calculated with.
        for task in tasks.values():
            math.ceil(task["seconds"] + task["peak_bytes"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError):
        return {}
    return tasks
