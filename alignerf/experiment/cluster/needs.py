"""Memory and minutes that a job asks for, from its scene's preflight.

Functions here make resource functions of Snakemake. On one machine these limit nothing.
A job that was killed, by its limits or otherwise, asks for twice as much the next time.
"""

import functools
import math
from pathlib import Path

from alignerf.experiment import layout
from alignerf.files import json_files

# Where the preflight says nothing: of a scene of phone photos.
MEMORY_MB, MINUTES = 8000, 240
# Beside the process that was measured runs Snakemake itself; all grows a little.
MORE_MEMORY, SNAKEMAKE_MB = 1.25, 500
# No number of a preflight is as large.
LARGEST = 1e15
# Nodes differ, and are shared.
MORE_TIME, START_MIN = 2.0, 10


def memory_mb(costs, file):
    """The resource mem_mb of the job that ends with a file below its scene's folder.

    costs: a mapping of scenes to the digest of what each has to do (`work.Digests`): a
    preflight of other work says nothing.
    file: with wildcards in braces, as `{training}/timing.json`.
    """

    def megabytes(wildcards, attempt):
        task = task_of(costs, wildcards, file)
        needed = task.get("peak_bytes", 0) / 1e6
        needed = MORE_MEMORY * needed + SNAKEMAKE_MB if needed else MEMORY_MB
        return math.ceil(needed) * 2 ** (attempt - 1)

    return megabytes


def minutes(costs, file):
    """The resource runtime, in minutes, of the same job."""

    def asked(wildcards, attempt):
        seconds = task_of(costs, wildcards, file).get("seconds")
        needed = MORE_TIME * seconds / 60 + START_MIN if seconds else MINUTES
        return math.ceil(needed) * 2 ** (attempt - 1)

    return asked


def usual_mb(wildcards, attempt):
    """The resource mem_mb of a job of which no preflight can tell."""
    return MEMORY_MB * 2 ** (attempt - 1)


def task_of(costs, wildcards, file) -> dict:
    """What the preflight says of the task that ends with a file; nothing without it."""
    path = Path("results") / wildcards.scene / "preflight.json"
    if not path.is_file():
        return {}
    digest, tasks = read(path, path.stat().st_mtime_ns)
    if digest is None or digest != costs[wildcards.scene]:
        return {}
    return tasks.get(f"results/{file.format(**wildcards)}", {})


@functools.lru_cache(maxsize=1024)
def read(path, written_ns):
    """(digest of its work, {output: task}) of a preflight.json, as it was then.

    Of what is no such file nothing: a plan must not end by it, since the preflight
    itself says what is wrong with it.
    """
    try:
        found = json_files.read(path)
        # By what rules call it: an output, of which the file is a part.
        tasks = {
            layout.output_of(f"results/{task['file']}"): task
            for task in found.get("tasks", [])
        }
        numbers = [t[key] for t in tasks.values() for key in ("seconds", "peak_bytes")]
        if not all(0 <= number < LARGEST for number in numbers):
            return None, {}
        return found.get("work"), tasks
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None, {}
