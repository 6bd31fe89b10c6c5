"""Renders of another program: `python -m alignerf.others.render`.

A job's command writes an image of every view, and their depth if it can; or they lie in
folders; or, without a job, the scene itself knows what belongs to which view
(`alignerf.scenes.judged`). They are checked and written as `alignerf.render_views`
writes ours: <view>.png, <view>.npz with depth, and a timing file, in folders with an
entry for each split.
"""

import argparse
import json
import shutil
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from alignerf.experiment.checks import places
from alignerf.files import atomic, faults, images, machine, owned, progress
from alignerf.others import commands, importing
from alignerf.scenes import prepared


def main(argv=None):
    args = parse(argv)
    job = args.config = args.config and commands.job_of(args.config)
    if job is None:
        judged(args)
    elif job.renders:
        names = {"scene": args.scene.name}
        folders = [f and places.filled(f, names) for f in (job.renders, job.depth)]
        take(args, *folders, seconds=0.0)
    else:
        # It stays where something is wrong with it, for its owner to look at.
        work = faults.resolved(args.training / "rendered")
        shutil.rmtree(work, ignore_errors=True)
        folders = {name: work / name for name in ("renders", "depth")}
        for folder in folders.values():
            folder.mkdir(parents=True)
        seconds = commands.run_of_job(job.render, args, **folders)
        take(args, *folders.values(), seconds=seconds)
        shutil.rmtree(work)


def take(args, renders, depth, *, seconds):
    """Write the renders and depths of folders, as of `importing.of_folders`."""
    loaded = prepared.load(args.scene, args.cameras)
    of_view = importing.of_folders(renders, depth, loaded, args.splits)
    write(args, loaded, of_view, seconds)


def judged(args):
    """Write the renders of a scene that is judged."""
    loaded = prepared.load(args.scene)
    of_view = importing.of_pairs(loaded)
    there = [name for name in prepared.SPLITS if (loaded.split == name).any()]
    if there != [name for name in prepared.SPLITS if name in args.splits]:
        told = f"{', '.join(args.splits)}; there are renders of {', '.join(there)}"
        raise ValueError(f"judged.splits: {told}")
    write(args, loaded, of_view, 0.0, threads=args.threads)


def write(args, loaded, of_view, seconds, threads=1):
    """Write the views of all splits, and how long each took.

    of_view: a function of a view: its image [h, w, 3], its depth [h, w]. seconds: of
    all views, which the command renders at once.
    """
    count = sum(len(loaded.views(split)) for split in args.splits)
    with ExitStack() as stack:
        for split in args.splits:
            renders, depths = (
                stack.enter_context(atomic.replace_folder(path / split))
                for path in (args.renders, args.depth)
            )

            def one(view, renders=renders, depths=depths):
                image, depth = of_view(view)
                images.write(renders / f"{loaded.names[view]}.png", image)
                known = np.where(depth > 0, depth, np.inf).astype(np.float32)
                np.savez(depths / f"{loaded.names[view]}.npz", depth=known)

            views = loaded.views(split)
            made = machine.map_in_threads(one, views, threads=threads)
            for _ in progress.over(made, f"renders {split}", total=len(views)):
                pass
        owned.put(args.timing, [f"{split}.json" for split in args.splits])
        for split in args.splits:
            views = len(loaded.views(split))
            timing = {"time_s": round(views * seconds / count, 3), "views": views}
            timing["view_time_s"] = round(seconds / count, 4)
            with atomic.replace_file(args.timing / f"{split}.json") as path:
                path.write_text(json.dumps(timing))


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.others.render", description=__doc__)
    commands.add_arguments(parser)
    parser.add_argument("--cameras", help="that renders are seen by")
    parser.add_argument("--splits", nargs="+", required=True, choices=prepared.SPLITS)
    for name in ("renders", "depth", "timing"):
        parser.add_argument(f"--{name}", type=Path, required=True, help="written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
