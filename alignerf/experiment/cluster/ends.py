"""Why Slurm has ended jobs, in words, from what Snakemake's plugin writes of them."""

import re

STATUS = re.compile(r"SLURM-job '(\d+)' failed.*?SLURM status is:\s+'(\w+)'", re.DOTALL)
REFUSED = re.compile(
    r"SLURM sbatch failed\. The error message was '(.*?)'\.", re.DOTALL
)
WORDS = {
    "OUT_OF_MEMORY": "took more memory than it had asked for",
    "TIMEOUT": "took longer than it had asked for",
    "NODE_FAIL": "lost its node",
    "CANCELLED": "was cancelled",
    "PREEMPTED": "had to give way to another",
}


def lines(text):
    """A line for each job that Slurm has ended, not a fault of its own, or refused."""
    ended = [
        f"error: Slurm's job {job} {WORDS[status]} ({status})"
        for job, status in dict(STATUS.findall(text)).items()
        if status in WORDS
    ]
    said = [words.replace("sbatch: error: ", "") for words in REFUSED.findall(text)]
    refused = [
        f"error: Slurm refused a job: {'; '.join(w.split(chr(10)))}" for w in said
    ]
    return [*ended, *dict.fromkeys(refused)]
