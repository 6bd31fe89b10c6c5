"""The job of another program's training: its commands, and what stands in braces."""

import json
from pathlib import Path
from typing import NamedTuple

from alignerf.experiment.checks import places
from alignerf.files import faults, owned, provenance
from alignerf.others import commands


class Job(NamedTuple):
    """An external training's slice of the config.

    train, render: commands with names in braces, or None. renders, depth: folders of
    finished ones instead, or None. seed, steps: numbers that stand in the commands.
    """

    train: str | None = None
    render: str | None = None
    renders: str | None = None
    depth: str | None = None
    seed: int | None = None
    steps: int | None = None


def read(text) -> Job:
    """The job that a command's option holds, as JSON; ValueError where it is none."""
    try:
        return Job(**json.loads(text)["external"])
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"--config is no external job: {error}") from None


def add_arguments(parser):
    """Options that both commands have."""
    parser.add_argument("--config", required=True, help="job as JSON")
    parser.add_argument("--scene", type=Path, required=True, help="results/SCENE")
    parser.add_argument("--training", type=Path, required=True, help="its folder")
    parser.add_argument("--data", type=Path, required=True, help="what it learns from")
    parser.add_argument("--model", type=Path, required=True, help="folder of the model")
    parser.add_argument("--cores", type=int, default=1, help="of the command")


def run(template, job: Job, args, **more) -> float:
    """Run a command, its names in braces filled; returns its seconds.

    args: as of `add_arguments`; more: further values. Folders are whole paths, as a
    command may change to another folder.
    """
    values = {
        "data": faults.resolved(args.data),
        "model": faults.resolved(args.model),
        "cores": args.cores,
        "seed": job.seed,
        "steps": job.steps,
        "scene": args.scene.name,
        "round": args.training.name.removeprefix("round"),
    }
    words = commands.words_of(template, values | more)
    seconds = commands.run(words, cores=args.cores)
    # What it keeps beside its data, as smaller photos, is no user's.
    if owned.is_marked(args.data):
        owned.seal(args.data)
    return seconds


def timing(steps, seconds):
    """The content of timing.json; what only the program knows is null.

    steps: None where they are not known; seconds: of training, 0 of finished renders.
    """
    return {
        "stage": "external",
        "steps": steps,
        "rays_seen": None,
        "params": None,
        "train_time_s": round(seconds, 3),
        "compile_time_s": 0.0,
        "device": None,
    } | provenance.facts()


def timing_of_views(views, view_time_s):
    """The content of a split's timing file; views: how many."""
    timed = {"time_s": round(views * view_time_s, 3), "views": views}
    return timed | {"view_time_s": round(view_time_s, 4)}


def folder_of(template, args):
    """A folder of finished renders, `{scene}` filled; None of None."""
    return template and Path(places.filled(template, {"scene": args.scene.name}))
