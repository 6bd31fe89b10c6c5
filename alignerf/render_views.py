"""Render the views of one split or of both: `python -m alignerf.render_views`.

One process for all views, so that code is compiled once; on a CPU each core renders
a view. Features become colours strip by strip: at 2560x1680 with N = 128 a view takes
0.4 GB besides the model, where its features alone would take 2.2. Writes <view>.png,
where asked <view>.npz with its depth, and a timing file, each where its path says,
in which `{split}` stands for the split.

depth [h, w] float32: along the optical axis (z-depth, not along the ray), in units
of the normalised scene (max |t| = 1), where half of a ray's weight is passed: the
middle of that interval, so its error is that interval's length at best.
"""

import argparse
import contextlib
import functools
import json
import time

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.command import faults, images, machine, progress, split_paths, whole
from alignerf.contributions import strips
from alignerf.experiment import jobs
from alignerf.scenes import cameras, prepared
from alignerf.systems import refine
from alignerf.training import checkpoint, compose, cores

# Rays at once: large enough to fill the machine, small enough for its memory.
CHUNK_RAYS = 4096
# Of these as many at a time on a CPU, so that what they need stays in its caches: a
# hash grid takes a quarter less time than with 128, an MLP no more.
CACHED_RAYS = 32
# Pixels whose features become colours at once, but at least a row of the image. The
# halo's rows, convolved once more with each strip, are 8 % of these at 2560 x 1680.
STRIP_PIXELS = 65536


def main(argv=None):
    args = parse(argv)
    machine.limit(args.threads)
    split_paths.check(args.splits, (args.renders, args.depth, args.timing))
    start = time.perf_counter()
    loaded = prepared.load(args.scene, args.cameras)
    job = jobs.parse(jobs.read(args.config))
    views = functools.partial(refine.views_of, loaded)
    method = compose.make_method(job, views, to_train=False)
    template = jax.eval_shape(method.init, jax.random.key(0))
    params = jax.tree.map(jnp.asarray, checkpoint.read_params(args.model, template))
    render = make_renderer(method, params, loaded.width, loaded.height)
    for split in args.splits:
        # What comes before the first view is counted with the first split.
        folders = [split_paths.of(path, split) for path in (args.renders, args.depth)]
        rendered = render_split(loaded, split, render, *folders)
        now = time.perf_counter()
        timing = {"time_s": round(now - start, 3), **rendered}
        start = now
        with whole.replace_file(split_paths.of(args.timing, split)) as path:
            path.write_text(json.dumps(timing))


def render_split(loaded: prepared.Scene, split, render, renders, depth=None):
    """Write images and, where it has a folder, depth; returns what a view took."""
    views = loaded.views(split)
    bar = progress.Progress(f"render {split}", len(views), unit="view")
    with contextlib.ExitStack() as stack:
        stack.enter_context(contextlib.closing(bar))
        folder, depths = (
            path and stack.enter_context(whole.replace_folder(path))
            for path in (renders, depth)
        )

        def render_view(view):
            image, found = render(loaded.pixtocams[view], loaded.camtoworlds[view])
            images.write(folder / f"{loaded.names[view]}.png", image)
            if depths is not None:
                np.savez(depths / f"{loaded.names[view]}.npz", depth=found)

        begun = time.perf_counter()
        # The first one alone: it compiles, which counts only if there is no other.
        render_view(views[0])
        bar.advance()
        if len(views) > 1:
            begun = time.perf_counter()
        for _ in cores.map_in_threads(render_view, views[1:]):
            bar.advance()
        rendered = time.perf_counter()
    view_time_s = round((rendered - begun) / max(len(views) - 1, 1), 4)
    return {"views": len(views), "view_time_s": view_time_s}


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--config", required=True, help="job as JSON, or its file")
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--cameras", help="cameras.npz (default: the scene's)")
    parser.add_argument("--model", required=True, help="trained parameters")
    parser.add_argument("--splits", nargs="+", required=True, choices=prepared.SPLITS)
    parser.add_argument("--renders", required=True, help="folder, written")
    parser.add_argument("--depth", help="folder of the views' depth, written")
    parser.add_argument("--timing", required=True, help="timing file, written")
    parser.add_argument("--threads", type=int, help="at most (default: every core)")
    return parser.parse_args(argv)


def make_renderer(method, params, width, height):
    """A function from a camera to (image [h, w, 3] uint8, depth [h, w] float32)."""
    count = width * height
    chunk = min(CHUNK_RAYS, -(-count // CACHED_RAYS) * CACHED_RAYS)
    on_cpu = jax.local_devices()[0].platform == "cpu"
    pixels = np.arange(-(-count // chunk) * chunk).clip(max=count - 1)
    strip = min(height, -(-STRIP_PIXELS // width))

    @jax.jit
    def values_of(params, pixel, pixtocam, camtoworld):
        def values_at(pixel):
            rays = cameras.pixels_to_rays(
                pixel % width, pixel // width, pixtocam, camtoworld
            )
            rendering = method.render(params, rays)
            return rendering.values, rendering.depth

        parts = pixel.reshape(-1, CACHED_RAYS if on_cpu else chunk)
        values, depth = jax.lax.map(values_at, parts)
        return jnp.concatenate(values), depth.ravel()

    @jax.jit
    def colours_of(params, values):
        return jnp.clip(method.colours(params, values), 0.0, 1.0)

    def paint(values):
        rgb = np.asarray(colours_of(params, values))
        if not np.isfinite(rgb).all():
            raise ValueError("the model renders colours that are not finite")
        return np.round(rgb * 255.0).astype(np.uint8)

    def render(pixtocam, camtoworld):
        camera = [jnp.asarray(m, jnp.float32) for m in (pixtocam, camtoworld)]
        depths = []

        def values():
            for part in pixels.reshape(-1, chunk):
                found, depth = values_of(params, jnp.asarray(part), *camera)
                depths.append(depth)
                yield found

        size = {"width": width, "height": height, "strip": strip, "halo": method.halo}
        image = strips.colours(values(), paint, **size)
        return image, np.concatenate(depths)[:count].reshape(height, width)

    return render


if __name__ == "__main__":
    faults.run(main)
