"""What a part of the model costs: seconds of a training step without it, or with less.

Each arm is a training of the demo's grid, put together and compiled on its own; they
take turns. A ratio is the whole model's seconds over the arm's: 1.1 means that the step
is a tenth faster without the part.
"""

import functools
from unittest import mock

import jax.numpy as jnp

from alignerf.experiment import jobs
from alignerf.mipnerf360 import coord
from tools.bench import cases, measure, ours

STEPS = 10
# What is left out -> (keys of the model, of its field, another contraction).
PARTS = {
    "the contraction": ({}, {}, True),
    "far samples (far 100 instead of 1e6)": ({"far": 100.0}, {}, False),
    "a round of proposals (32 and 12 samples)": ({"samples": [32, 12]}, {}, False),
    "a quarter of the samples (24, 12 and 9)": ({"samples": [24, 12, 9]}, {}, False),
    "half the samples (16, 8 and 6)": ({"samples": [16, 8, 6]}, {}, False),
    "a level of six": ({}, {"levels": 5}, False),
    "two levels of six": ({}, {"levels": 4}, False),
    "three quarters of the table (2^13 rows)": ({}, {"log2_hashmap_size": 13}, False),
    "the finest cells (finest 512)": ({}, {"max_resolution": 512}, False),
}
QUICK = ("the contraction", "half the samples (16, 8 and 6)")


def run(options):
    """Rows: a step's seconds without each part, beside those of the whole model."""
    names = QUICK if options.quick else PARTS
    photos = cases.orbit(width=64, height=64)
    arms = {"whole": steps_of(photos, {}, {}, False)}
    arms |= {name: steps_of(photos, *PARTS[name]) for name in names}
    times = measure.interleave(arms, options.repeats)
    return [
        measure.Row(
            what=f"without {name}",
            unit="ms a step",
            ours=measure.spread(1e3 * s / STEPS for s in times[name]),
            peer=measure.spread(1e3 * s / STEPS for s in times["whole"]),
            ratio=measure.spread(
                whole / s for whole, s in zip(times["whole"], times[name], strict=True)
            ),
            note="peer: the whole model",
        )
        for name in names
    ]


def steps_of(photos, model, field, straight):
    """A call that takes some steps of the demo's grid and training, with other keys."""
    changed = cases.GRID | model
    changed = changed | {"field": changed["field"] | field}
    job = jobs.parse(
        {
            "seed": 0,
            "stage": "full",
            "model": changed,
            "training": {"steps": 2000},
            "alignerf": None,
        }
    )
    if straight:
        with mock.patch.object(coord, "contract_spheres", as_they_are):
            return functools.partial(several, ours.Training(job, photos))
    return functools.partial(several, ours.Training(job, photos))


def several(training):
    """Some steps; what the last one gives."""
    for _ in range(STEPS):
        found = training()
    return found


def as_they_are(gaussians):
    """`contract_spheres` without contraction: what is far lies outside the grid."""
    length_std = gaussians.t_std * jnp.linalg.norm(gaussians.direction, axis=-1)
    roots = coord.cube_root(length_std), coord.cube_root(gaussians.r_std)
    return gaussians.mean, roots[0] * roots[1] ** 2
