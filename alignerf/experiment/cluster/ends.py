"""Why Slurm has ended jobs, in words, from what Snakemake's plugin writes of them."""

import re

STATUS = re.compile(r"SLURM-job '(\d+)' failed.*?SLURM status is:\s+'(\w+)'", re.DOTALL)
WORDS = {
    "OUT_OF_MEMORY": "took more memory than it had asked for",
    "TIMEOUT": "took longer than it had asked for",
    "NODE_FAIL": "lost its node",
    "CANCELLED": "was cancelled",
    "PREEMPTED": "had to give way to another",
}


def lines(text):
    """A line for each job that Slurm has ended, not a fault of its own."""
    return [
        f"error: Slurm's job {job} {WORDS[status]} ({status})"
        for job, status in dict(STATUS.findall(text)).items()
        if status in WORDS
    ]
