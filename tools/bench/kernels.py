"""What the kernels in C++ bring: a step, a render and a compilation, with and without.

Both take turns, in seconds of this process's own cores: what else runs on the machine
makes both slower, and the ratio hardly. One core, as a training of the demo has. And
what a step takes that learns the cameras too, beside one that does not.
"""

import functools
import time

from alignerf.cameras import refine
from alignerf.experiment import jobs
from alignerf.training import compose
from tools.bench import cases, measure, ours, parts

CHOICES = ("native", "jax")
# The field of the demo, and one that looks nothing up.
MODELS = {"grid": cases.GRID, "small MLP": cases.SMALL}
SIZE = 64


def run(options):
    """Rows of each model: seconds by the kernels, beside those by JAX's own code."""
    names = ("grid",) if options.quick else MODELS
    rows = [row for name in names for row in rows_of(name, options.repeats)]
    return [*rows, *learning(options.repeats)]


def learning(repeats):
    """Rows by each code: a plain step's seconds beside those of one that learns."""
    photos = cases.orbit(width=SIZE, height=SIZE)
    cameras = refine.Views(photos.pixtocams, photos.camtoworlds, (SIZE, SIZE))
    scales = refine.scales_of(cameras, preconditioned=True)
    for choice in CHOICES:
        job = job_of("grid", choice, pose_optimization={})
        method = compose.without_cameras(job, to_train=True, learning=True)
        method = refine.refined(method, scales, prior_weight=job.learns.prior_weight)
        arms = {
            "learning": ours.Training(job, photos, method),
            "plain": training("grid", choice, photos),
        }
        steps = {n: functools.partial(parts.several, one) for n, one in arms.items()}
        times = measure.interleave(steps, repeats, clock=time.process_time)
        yield measure.Row(
            what=f"grid, {choice}: a step that learns the cameras",
            unit="ms",
            ours=measure.spread(1e3 * s / parts.STEPS for s in times["learning"]),
            peer=measure.spread(1e3 * s / parts.STEPS for s in times["plain"]),
            ratio=measure.spread(
                a / b for a, b in zip(times["learning"], times["plain"], strict=True)
            ),
            goal=measure.Goal("ratio", "<=", 1.3) if choice == "native" else None,
            note="peer: a plain step",
        )


def rows_of(name, repeats):
    photos = cases.orbit(width=SIZE, height=SIZE)
    trainings = {choice: training(name, choice, photos) for choice in CHOICES}
    steps = {c: functools.partial(parts.several, one) for c, one in trainings.items()}
    views = {c: one.view(photos, 0) for c, one in trainings.items()}
    times = functools.partial(
        measure.interleave, repeats=repeats, clock=time.process_time
    )
    yield row(f"{name}: a step", "ms", 1e3 / parts.STEPS, times(steps))
    pixels = SIZE**2 / 1e3
    yield row(f"{name}: a render", "ms a 1000 px", 1e3 / pixels, times(views))
    compiled = {choice: [one.compile_s] for choice, one in trainings.items()}
    yield row(f"{name}: compiling a step", "s", 1.0, compiled)


def job_of(name, choice, **more):
    """The job of a model, with its kernels chosen."""
    values = {"seed": 0, "stage": "full", "model": MODELS[name], "alignerf": None}
    return jobs.parse(values | {"training": {"steps": 2000, "kernels": choice}} | more)


def training(name, choice, photos):
    """Its training."""
    return ours.Training(job_of(name, choice), photos)


def row(what, unit, scale, times):
    """A row of both; the ratio is that of JAX's own code over the kernels'."""
    native, jax_s = (times[choice] for choice in CHOICES)
    return measure.Row(
        what=what,
        unit=unit,
        ours=measure.spread(scale * s for s in native),
        peer=measure.spread(scale * s for s in jax_s),
        ratio=measure.spread(b / a for a, b in zip(native, jax_s, strict=True)),
        note="peer: JAX's own code",
    )
