"""Why Slurm has ended or refused jobs, in words: from what its plugin writes."""

import re
from pathlib import Path

STATUS = re.compile(r"SLURM-job '(\d+)' failed.*?SLURM status is:\s+'(\w+)")
REFUSED = re.compile(
    r"SLURM sbatch failed\. The error message was '(.*?)'\.", re.DOTALL
)
WORDS = {
    "OUT_OF_MEMORY": "took more memory than it had asked for",
    "TIMEOUT": "took longer than it had asked for",
    "NODE_FAIL": "lost its node",
    "BOOT_FAIL": "lost its node",
    "DEADLINE": "took longer than it had asked for",
    "CANCELLED": "was cancelled",
    "PREEMPTED": "had to give way to another",
}
# The state of a job whose last step alone was out of memory is FAILED: its log tells.
LOGS, OUT_OF_MEMORY = "slurm_logs", "oom-kill event"


def lines(text, logs):
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
    said = [words.replace("sbatch: error: ", "") for words in REFUSED.findall(text)]
    refused = [f"error: Slurm refused a job: {'; '.join(w.splitlines())}" for w in said]
    return [*ended, *dict.fromkeys(refused)]


def is_slurms(log) -> bool:
    """Whether a job's log is Slurm's own, beside that of the job's command."""
    return LOGS in Path(log).parts


def read(log):
    return log.read_text(encoding="utf-8", errors="replace")
