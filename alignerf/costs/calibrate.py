"""Time a training's step: `python -m alignerf.costs.calibrate`.

The process has the threads and devices of the job, so that the job later takes the
compiled program from JAX's cache. It compiles twice: the second time, from the cache,
is the job's. Writes JSON to stdout. Without a scene it compiles for any scene.
"""

import json
import time
import types

import jax

from alignerf.costs import estimate
from alignerf.experiment import jobs
from alignerf.io import faults, machine
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

# Steps are timed so long.
TIMING_S = 3.0
# Of a photo with more pixels than are rendered at once.
SIDE_PX = 1024


OPTIONS = {
    "config": "job as JSON, or its file",
    "[scene]": "prepared scene folder",
    "[threads]": faults.THREADS,
    "[gpus]": faults.GPUS,
    "[started]": ("when, in seconds since 1970", float),
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    devices.begin(args.threads, args.gpus)
    started = time.time() if args.started is None else args.started
    job = jobs.read(args.config)
    if program.hashed(job.model):
        devices.use_as_devices()
    if args.scene:
        rates = rates_of(job, prepared.load(args.scene), started)
    else:
        compile_ahead(job)
        rates = estimate.Rates()
    print(json.dumps(rates._asdict()))


def compile_ahead(job):
    """Compile a job's step and renderer, which know nothing of a scene."""
    method = compose.without_cameras(job)
    params = jax.jit(method.init)(jax.random.key(0))
    size = types.SimpleNamespace(width=SIDE_PX, height=SIDE_PX)
    program.build(job, method, params, batches.view_shapes(size, [0]))
    renderer.compile_ahead(method, params, SIDE_PX, SIDE_PX)


def rates_of(job, loaded: prepared.Scene, started) -> estimate.Rates:
    """Seconds to start (programs are cached), and of a step; peak in bytes."""
    chosen = loaded.views("train")
    method = compose.make_method(job, loaded)
    params = jax.jit(method.init)(jax.random.key(job.seed))
    shapes = batches.view_shapes(loaded, chosen)
    begun = time.time()
    program.build(job, method, params, shapes, to_come=memory.tree_bytes(shapes))
    jax.clear_caches()
    started += time.time() - begun
    built = program.build(job, method, params, shapes)
    views = batches.load_views(loaded, chosen, loaded.folder / "images")
    checkpoint.digest((params, views))
    start_s = time.time() - started
    step_s = loop.step_time_s(job, built, params, views, max_s=TIMING_S)
    return estimate.Rates(start_s, step_s, machine.peak_bytes())


if __name__ == "__main__":
    faults.run(main)
