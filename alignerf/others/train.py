"""Train by another program: `python -m alignerf.others.train`.

Its command gets a folder of photos and cameras (`alignerf.others.data`), and one for
its model. That one stays when the job is killed or fails, for a program that can
resume; a training of something else finds it empty. Writes timing.json, and the cameras
that its renders are seen by. Of finished renders nothing is trained.
"""

import argparse
import hashlib
import json
import logging
import shutil
from pathlib import Path

from alignerf.files import atomic, faults, owned
from alignerf.others import commands

log = logging.getLogger("alignerf")

# Beside the model while it is not done.
BEGUN = "model.begun"


def main(argv=None):
    args = parse(argv)
    job = args.config = commands.job_of(args.config)
    seconds = train(job, args) if job.train else 0.0
    timing = commands.timing(job.steps, seconds)
    with (
        atomic.replace_file(args.timing) as path,
        atomic.replace_folder(args.learnt) as folder,
    ):
        shutil.copyfile(args.cameras, folder / "cameras.npz")
        path.write_text(json.dumps(timing, indent=1))


def train(job: commands.Job, args) -> float:
    """Run the command in a folder of its own; returns its seconds.

    A file beside the folder says what it is of while it is not done.
    """
    begun = args.model.with_name(BEGUN)
    digest = digest_of(job, args.data)
    same = begun.is_file() and faults.content(begun) == digest.encode()
    if not same:
        shutil.rmtree(args.model, ignore_errors=True)
    elif args.model.is_dir() and any(args.model.iterdir()):
        log.info("{model} is that of a run that was stopped")
    args.model.mkdir(parents=True, exist_ok=True)
    with atomic.replace_file(begun) as path:
        path.write_text(digest)
    seconds = commands.run_of_job(job.train, args)
    begun.unlink()
    if not any(args.model.iterdir()):
        log.warning("the command has written nothing below {model}")
    log.info("trained in %.1f s", seconds)
    return seconds


def digest_of(job: commands.Job, data: Path):
    """SHA-256 of the command, its numbers and all that it learns from."""
    found = hashlib.sha256(json.dumps([job.train, job.seed, job.steps]).encode())
    names = owned.listed(data) if owned.is_marked(data) else owned.files_of(data)
    for path in filter(Path.is_file, sorted(data / name for name in names)):
        found.update(str(path.relative_to(data)).encode())
        with open(path, "rb") as file:
            found.update(hashlib.file_digest(file, "sha256").digest())
    return found.hexdigest()


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.others.train", description=__doc__)
    commands.add_arguments(parser)
    parser.add_argument("--cameras", required=True, help="of the round")
    parser.add_argument("--learnt", type=Path, required=True, help="folder, written")
    parser.add_argument("--timing", type=Path, required=True, help="file, written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
