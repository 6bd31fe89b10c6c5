"""Renders of a scene that is judged: `python -m alignerf.others.judged`.

They are written as our own are: <view>.png, <view>.npz with depth, and a timing file,
each where its path says, in which `{split}` stands for the split. What belongs to which
view the scene itself knows (`alignerf.scenes.judged`). Nothing is trained.
"""

import argparse
import json
import logging
import shutil
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from alignerf.files import (
    archives,
    atomic,
    faults,
    images,
    machine,
    progress,
    split_paths,
)
from alignerf.others import jobs
from alignerf.scenes import cameras, distortion, prepared
from alignerf.scenes.judged import depths, renders, views

log = logging.getLogger("alignerf")


def main(argv=None):
    args = parse(argv)
    split_paths.check(args.splits, (args.renders, args.depth, args.time))
    loaded, pairs = prepared.load(args.scene), views.read_pairs(args.scene)
    if pairs is None:
        raise ValueError(f"{args.scene / views.PAIRS}: not found")
    check_splits(loaded, args.splits)
    with ExitStack() as stack:
        # Entered first, so in place last: it says that the others are whole.
        timing_path = stack.enter_context(atomic.replace_file(args.timing))
        learnt = stack.enter_context(atomic.replace_folder(args.learnt))
        shutil.copyfile(args.scene / "cameras.npz", learnt / "cameras.npz")
        for split in args.splits:
            folders = [
                stack.enter_context(
                    atomic.replace_folder(split_paths.fill(path, split))
                )
                for path in (args.renders, args.depth)
            ]
            take(loaded, pairs, loaded.views(split), split, folders, args.threads)
            timing = jobs.timing_of_views(len(loaded.views(split)), 0.0)
            with split_paths.replace_file(args.time, split) as path:
                path.write_text(json.dumps(timing))
        # Somebody else has trained it.
        timing_path.write_text(json.dumps(jobs.timing(None, 0.0), indent=1))


def check_splits(loaded, splits):
    """ValueError where the config says other splits than there are renders of."""
    there = [name for name in prepared.SPLITS if (loaded.split == name).any()]
    if there != [name for name in prepared.SPLITS if name in splits]:
        raise ValueError(
            f"judged.splits: {', '.join(splits)}; there are renders of "
            f"{', '.join(there)}"
        )


def take(loaded, pairs, chosen, split, folders, threads):
    """Write the renders and depths of some views into two folders."""
    own = prepared.read_cameras(loaded.folder / "cameras.npz")
    scale = cameras.frame_of(own["camtoworlds"]).scale
    points = None
    if pairs["depth"] == "points":
        path = loaded.folder / prepared.POINTS
        points = archives.read(path, ("points",))["points"]

    def write(view):
        name = loaded.names[view]
        pair = pairs["views"][name]
        camtopix = np.linalg.inv(loaded.pixtocams[view])
        render = renders.Render(Path(pair["render"]), pair["is_sheet"])
        image, _ = views.read_render(render, pairs.get("background"))
        if lens := lens_of(pair):
            image = distortion.undistort(image, *lens, camtopix)
        images.write(folders[0] / f"{name}.png", image)
        depth = scale * depth_of(pairs, pair, own, view, points)
        depth = np.where(depth > 0, depth, np.inf).astype(np.float32)
        with open(folders[1] / f"{name}.npz", "wb") as file:
            np.savez(file, depth=depth)

    made = machine.map_in_threads(write, chosen, threads=threads)
    for _ in progress.over(made, f"renders {split}", total=len(chosen)):
        pass


def lens_of(pair):
    """(camtopix, distortion) of a render that shows the distortion, else None."""
    return pair["lens"] and tuple(map(np.array, pair["lens"]))


def depth_of(pairs, pair, own, view, points):
    """Depth [h, w] along the optical axis, in the unit of the cameras as given."""
    size = int(own["width"]), int(own["height"])
    pixtocam = own["pixtocams"][view]
    if points is not None:
        return depths.of_points(points, pixtocam, own["camtoworlds"][view], size)
    if pairs["depth"] == "given" and pair["depth"]:
        values = depths.read(pair["depth"])
        values = depths.as_shown(values, pixtocam, size, lens_of(pair))
        along = depths.along_axis(values, pairs["depth_kind"], pixtocam)
        return pairs["depth_scale"] * along
    return np.full(size[::-1], np.inf, np.float32)


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.others.judged", description=__doc__)
    parser.add_argument("--scene", type=Path, required=True, help="results/SCENE")
    parser.add_argument("--splits", nargs="+", required=True, choices=prepared.SPLITS)
    parser.add_argument("--renders", required=True, help="folder, written")
    parser.add_argument("--depth", required=True, help="folder, written")
    parser.add_argument("--time", required=True, help="timing files, written")
    parser.add_argument("--learnt", type=Path, required=True, help="folder, written")
    parser.add_argument("--timing", type=Path, required=True, help="file, written")
    parser.add_argument("--threads", type=int, default=1, help="views at once")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
