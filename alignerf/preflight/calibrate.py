"""Time a training's step, or a rendering: `python -m alignerf.preflight.calibrate`.

The process has the threads and devices of the job, so that the job later takes the
compiled programs from JAX's cache. Everything is compiled twice: the second time, from
the cache, is the job's. Writes JSON to stdout.
"""

import argparse
import json
import pathlib
import time

import jax
import numpy as np

from alignerf.cameras import refine
from alignerf.experiment import jobs
from alignerf.files import faults, machine
from alignerf.processes import devices
from alignerf.scenes import prepared
from alignerf.training import (
    batches,
    checkpoint,
    compose,
    loop,
    memory,
    program,
    renderer,
)

# Steps are timed so long; pixels are rendered at once.
TIMING_S, PIXELS = 3.0, 16384
# In place of one that is measured when the flow is: that program is compiled anew.
RADIUS_PX = 4


def main(argv=None):
    parser = argparse.ArgumentParser(prog="calibrate", description=__doc__)
    parser.add_argument("--config", required=True, help="job as JSON, or its file")
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--what", required=True, choices=("train", "render"))
    parser.add_argument("--threads", type=int, help="at most (default: every core)")
    parser.add_argument("--started", type=float, help="when, in seconds since 1970")
    args = parser.parse_args(argv)
    machine.limit(args.threads)
    devices.take_accelerator()
    started = time.time() if args.started is None else args.started
    job = with_radius(jobs.parse(jobs.read(args.config)))
    measure = {"train": of_training, "render": of_rendering}[args.what]
    rates = measure(job, args.scene, started)
    print(json.dumps(rates))


def with_radius(job):
    """The job with a search radius; RADIUS_PX where its own is still unknown."""
    if job.stage != "finetune" or job.alignerf.radius_px is not None:
        return job
    settings = job.alignerf.model_copy(update={"radius_px": RADIUS_PX})
    return job.model_copy(update={"alignerf": settings})


def of_training(job, scene, started):
    """Seconds to start, to compile from the cache and of a step; peak in bytes."""
    if program.hashed(job.model):
        devices.use_as_devices()
    loaded = prepared.load(scene)
    chosen = loaded.views("train")
    method = compose.make_method(job, lambda: refine.views_of(loaded))
    params = jax.jit(method.init)(jax.random.key(job.seed))
    shapes = batches.view_shapes(loaded, chosen)
    start_s = time.time() - started
    program.build(job, method, params, shapes, to_come=memory.tree_bytes(shapes))
    forget_compiled()
    built = program.build(job, method, params, shapes)
    begun = time.time()
    views = batches.load_views(loaded, chosen, loaded.folder / "images")
    checkpoint.digest((params, views))
    count = sum(leaf.size for leaf in jax.tree.leaves(params))
    start_s += time.time() - begun
    step_s = loop.step_time_s(job, built, params, views, most_s=TIMING_S)
    return {
        "start_s": start_s,
        "compile_s": built.compile_time_s,
        "step_s": step_s,
        "params": count,
        "peak_bytes": machine.peak_bytes(),
    }


def of_rendering(job, scene, started):
    """Seconds to start, to compile from the cache and of a pixel; peak in bytes."""
    loaded = prepared.load(scene)
    method = compose.make_method(job, lambda: refine.views_of(loaded), to_train=False)
    params = jax.jit(method.init)(jax.random.key(job.seed))
    start_s = time.time() - started
    # Some rows: the program of rays is the same for each height.
    height = min(loaded.height, -(-PIXELS // loaded.width))
    views = np.resize(np.arange(len(loaded.names)), machine.cores())

    def timed(views):
        render = renderer.make_renderer(method, params, loaded.width, height)
        return timed_again(render, views)

    def timed_again(render, views):
        def one(view):
            render(loaded.pixtocams[view], loaded.camtoworlds[view])

        begun = time.perf_counter()
        list(devices.map_in_threads(one, views))
        return time.perf_counter() - begun, render

    timed(views[:1])
    forget_compiled()
    first_s, render = timed(views[:1])
    single_s, _ = timed_again(render, views[:1])
    all_s, _ = timed_again(render, views)
    return {
        "render_start_s": start_s,
        "render_compile_s": max(0.0, first_s - single_s),
        "pixel_s": all_s / (len(views) * height * loaded.width),
        "render_peak_bytes": machine.peak_bytes(),
    }


def forget_compiled():
    """Forget the compiled programs, as in a new process with a filled cache."""
    jax.clear_caches()
    memory.give_back()
    try:
        # Linux then counts the largest size from now on.
        pathlib.Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


if __name__ == "__main__":
    faults.run(main)
