"""Render the views of one split or of both: `python -m alignerf.render_views`.

One process for all views, so that code is compiled once, and a thread for each core,
which on a CPU renders a view. Writes <view>.png, where asked <view>.npz with its depth,
and a timing file, below the folders that are named, each with an entry for each split.

depth [h, w] float32: along the optical axis (z-depth, not along the ray), in units
of the normalized scene (max |t| = 1), where half of a ray's weight is passed: the
middle of that interval, so its error is that interval's length at best.
"""

import contextlib
import json
import time
from pathlib import Path

import numpy as np

from alignerf.io import atomic, faults, images, machine, owned, progress
from alignerf.processes import devices
from alignerf.scenes import prepared
from alignerf.training import renderer

OPTIONS = {
    "config": "job as JSON, or its file",
    "scene": "prepared scene folder",
    "[cameras]": "cameras.npz (default: the scene's)",
    "model": "trained parameters",
    "splits": ("of the views", {"choices": prepared.SPLITS} | faults.SEVERAL),
    "renders": ("folder, written", Path),
    "[depth]": ("folder of the views' depth, written", Path),
    "timing": ("folder, written", Path),
    "[threads]": faults.THREADS,
    "[gpus]": faults.GPUS,
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    devices.begin(args.threads, args.gpus)
    owned.put(args.timing, [f"{split}.json" for split in args.splits])
    start = time.perf_counter()
    loaded = prepared.load(args.scene, args.cameras)
    method, params = renderer.read_model(args.config, args.model, loaded)
    render = renderer.make_renderer(method, params, loaded.width, loaded.height)
    for split in args.splits:
        # What comes before the first view is counted with the first split.
        depth = args.depth and args.depth / split
        rendered = render_split(loaded, split, render, args.renders / split, depth)
        now = time.perf_counter()
        timing = {"time_s": round(now - start, 3), **rendered}
        start = now
        with atomic.replace_file(args.timing / f"{split}.json") as path:
            path.write_text(json.dumps(timing))


def render_split(loaded: prepared.Scene, split, render, renders, depth=None):
    """Write images and, where it has a folder, depth; returns what a view took."""
    views = loaded.views(split)
    bar = progress.Progress(f"render {split}", len(views), unit="view")
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.closing(bar))
        folder, depths = (
            path and stack.enter_context(atomic.replace_folder(path))
            for path in (renders, depth)
        )

        def render_view(view):
            image, depth_map = render(loaded.pixtocams[view], loaded.camtoworlds[view])
            images.write(folder / f"{loaded.names[view]}.png", image)
            if depths is not None:
                np.savez(depths / f"{loaded.names[view]}.npz", depth=depth_map)

        begun = time.perf_counter()
        # The first one alone: it compiles, which counts only if there is no other.
        render_view(views[0])
        bar.advance()
        if len(views) > 1:
            begun = time.perf_counter()
        for _ in machine.map_in_threads(render_view, views[1:]):
            bar.advance()
        rendered = time.perf_counter()
    view_time_s = round((rendered - begun) / max(len(views) - 1, 1), 4)
    return {"views": len(views), "view_time_s": view_time_s}


if __name__ == "__main__":
    faults.run(main)
