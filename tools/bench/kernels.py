"""What the kernels in C++ bring: a step, a render and a compilation, with and without.

Both take turns, in seconds of this process's own cores: what else runs on the machine
makes both slower, and the ratio hardly. One core, as a training of the demo has.
"""

import functools
import time

from alignerf.experiment import jobs
from tools.bench import cases, measure, ours, parts

CHOICES = ("native", "jax")
# The field of the demo, and one that looks nothing up.
MODELS = {"grid": cases.GRID, "small MLP": cases.SMALL}
SIZE = 64


def run(options):
    """Rows of each model: seconds by the kernels, beside those by JAX's own code."""
    names = ("grid",) if options.quick else MODELS
    return [row for name in names for row in rows_of(name, options.repeats)]


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


def training(name, choice, photos):
    """The training of a model, with its kernels chosen."""
    values = {"seed": 0, "stage": "full", "model": MODELS[name], "alignerf": None}
    values["training"] = {"steps": 2000, "kernels": choice}
    return ours.Training(jobs.parse(values), photos)


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
