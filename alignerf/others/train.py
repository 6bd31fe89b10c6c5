"""Train by another program: `python -m alignerf.others.train`.

Its command gets a folder of photos and cameras (`alignerf.others.data`), and one for
its model, which stays when the job is killed: whether it resumes there is its own
affair. Writes timing.json, and the cameras that its renders are seen by. Of finished
renders nothing is trained.
"""

import argparse
import json
import logging
import shutil
from pathlib import Path

from alignerf.files import atomic, faults, provenance
from alignerf.others import jobs

log = logging.getLogger("alignerf")


def main(argv=None):
    args = parse(argv)
    job, seconds = jobs.read(args.config), 0.0
    if job.train:
        args.model.mkdir(parents=True, exist_ok=True)
        seconds = jobs.run(job.train, job, args)
        if not any(args.model.iterdir()):
            log.warning("the command has written nothing below {model}")
        log.info("trained in %.1f s", seconds)
    # What only the program knows is null.
    timing = {
        "stage": "external",
        "steps": job.steps,
        "rays_seen": None,
        "params": None,
        "train_time_s": round(seconds, 3),
        "compile_time_s": 0.0,
        "device": None,
    } | provenance.facts()
    with (
        atomic.replace_file(args.timing) as path,
        atomic.replace_folder(args.learnt) as folder,
    ):
        shutil.copyfile(args.cameras, folder / "cameras.npz")
        path.write_text(json.dumps(timing, indent=1))


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.others.train", description=__doc__)
    jobs.add_arguments(parser)
    parser.add_argument("--cameras", required=True, help="of the round")
    parser.add_argument("--learnt", type=Path, required=True, help="folder, written")
    parser.add_argument("--timing", type=Path, required=True, help="file, written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
