"""Render by another program: `python -m alignerf.others.render`.

Its command writes an image of every view, and their depth if it can. They are checked
and written as `alignerf.render_views` writes ours: <view>.png, <view>.npz with depth,
and a timing file, each where its path says, in which `{split}` stands for the split.
"""

import argparse
import json
import shutil

from alignerf.files import faults, split_paths
from alignerf.others import importing, jobs
from alignerf.scenes import prepared


def main(argv=None):
    args = parse(argv)
    outs = args.renders, args.depth
    split_paths.check(args.splits, (*outs, args.timing))
    job = jobs.read(args.config)
    loaded = prepared.load(args.scene, args.cameras)
    if job.renders:
        folders = (jobs.folder_of(f, args) for f in (job.renders, job.depth))
        count = importing.take(*folders, loaded, args.splits, *outs)
        seconds = 0.0
    else:
        # It stays where something is wrong with it, for its owner to look at.
        work = faults.resolved(args.training / "rendered")
        shutil.rmtree(work, ignore_errors=True)
        folders = {name: work / name for name in ("renders", "depth")}
        for folder in folders.values():
            folder.mkdir(parents=True)
        seconds = jobs.run(job.render, job, args, **folders)
        count = importing.take(*folders.values(), loaded, args.splits, *outs)
        shutil.rmtree(work)
    # The command renders all views at once.
    view_time_s = seconds / count
    for split in args.splits:
        timing = jobs.timing_of_views(len(loaded.views(split)), view_time_s)
        with split_paths.replace_file(args.timing, split) as path:
            path.write_text(json.dumps(timing))


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.others.render", description=__doc__)
    jobs.add_arguments(parser)
    parser.add_argument("--cameras", required=True, help="that renders are seen by")
    parser.add_argument("--splits", nargs="+", required=True, choices=prepared.SPLITS)
    parser.add_argument("--renders", required=True, help="folder, written")
    parser.add_argument("--depth", required=True, help="folder, written")
    parser.add_argument("--timing", required=True, help="timing file, written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
