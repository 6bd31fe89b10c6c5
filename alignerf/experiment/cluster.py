"""What jobs ask of a cluster, results in a storage, and why Slurm has ended jobs."""

import os
import re
from pathlib import Path

from alignerf.io import owned

STATUS = re.compile(r"SLURM-job '(\d+)' failed.*?SLURM status is:\s+'(\w+)")
REFUSED = re.compile(
    r"SLURM sbatch failed\. The error message was '(.*?)'\.", re.DOTALL
)
WORDS = {
    "OUT_OF_MEMORY": "took more memory than it had asked for",
    "TIMEOUT": "took longer than it had asked for",
    "NODE_FAIL": "lost its node",
    "CANCELLED": "was canceled",
    "PREEMPTED": "had to give way to another",
}
# The state of a job whose last step alone was out of memory is FAILED: its log tells.
LOGS, OUT_OF_MEMORY = "slurm_logs", "oom-kill event"


# A training of phone photos.
MEMORY_MB, MINUTES = 8000, 240


def usual_mb(wildcards, attempt):
    """The resource mem_mb; a job that was killed asks for twice as much."""
    return MEMORY_MB * 2 ** (attempt - 1)


def minutes(wildcards, attempt):
    """The resource runtime, likewise."""
    return MINUTES * 2 ** (attempt - 1)


def link(scenes, output, results="results"):
    """Let results/SCENE lead to where a storage's files lie while jobs use them.

    Of a job Snakemake moves the files that its rule names; its command finds these, as
    without a storage, below the scene's folder. output: where Snakemake has a file that
    a rule writes there.
    Raises ValueError for results that are others'.
    """
    copies = Path(output).parents[1]
    in_storage = copies != Path(results)
    for scene in scenes:
        there, copy = Path(results) / scene, copies.absolute() / scene
        if not in_storage:
            if there.is_symlink() and owned.STORAGE in os.readlink(there):
                raise ValueError(f"{there}: leads into a storage: remove this link")
            continue
        copy.mkdir(parents=True, exist_ok=True)
        there.parent.mkdir(exist_ok=True)
        if not os.path.lexists(there):
            there.symlink_to(copy)
        if there.resolve() != copy.resolve():
            raise ValueError(
                f"{there}: lies on the disk, or in another storage: run where it does "
                "not, or move it away"
            )


def slurm_errors(text, logs):
    """A line for each job that Slurm has ended, not a fault of its own, or refused.

    text: Snakemake's log; logs: all that it names of jobs that failed.
    """
    states = dict(STATUS.findall(text))
    for log in map(Path, logs):
        if is_slurms(log) and log.is_file() and OUT_OF_MEMORY in read(log):
            states[log.stem] = "OUT_OF_MEMORY"
    ended = [
        f"error: Slurm's job {job} {WORDS[state]} ({state})"
        for job, state in states.items()
        if state in WORDS
    ]
    refused = [
        f"error: Slurm refused a job: {'; '.join(words.splitlines())}"
        for words in REFUSED.findall(text.replace("sbatch: error: ", ""))
    ]
    return [*ended, *dict.fromkeys(refused)]


def is_slurms(log) -> bool:
    """Whether a job's log is Slurm's own, beside that of the job's command."""
    return LOGS in Path(log).parts


def read(log):
    return log.read_text(encoding="utf-8", errors="replace")
