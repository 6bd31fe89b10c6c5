"""One training step of every system of the paper's Table 3, at its published size.

Systems and settings are those of table3.yaml, and mip-NeRF 360 with 4096 channels
of Table 1; a few rays, since on a CPU a published batch takes minutes. Steps of all
systems take turns. A loss or a gradient that is not finite ends the benchmark.
"""

import json

import jax
import numpy as np

from alignerf.experiment import jobs
from tools.bench import cases, clusters, measure, ours

RAYS = 64
WIDE = "mip-NeRF 360, 4096 channels"


def run(options):
    """Rows: rays a second of a step of each; its parameters in the note."""
    found = {name: job for _, name, _, job, _ in clusters.trainings_of(3)}
    wide = json.loads(json.dumps(found["mipnerf360"]))
    wide["model"]["field"]["width"] = 4096
    found[WIDE] = wide
    if options.quick:
        found = dict([next(iter(found.items()))])
    parsed = {name: clusters.small(job, RAYS, options) for name, job in found.items()}
    arms = {name: Step(job) for name, job in parsed.items()}
    times = measure.interleave(arms, max(1, options.repeats // 2))
    return [
        measure.rates(
            f"train {name}, {parsed[name].rays_per_step} rays",
            {"ours": seconds},
            parsed[name].rays_per_step,
            note=f"{arms[name].parameters:,} parameters",
        )
        for name, seconds in times.items()
    ]


class Step:
    """A training whose every step is looked at."""

    def __init__(self, job: jobs.Job):
        self.training = ours.Training(job, cases.orbit())
        self.parameters = self.training.parameters

    def __call__(self):
        found = jax.device_get(self.training()[1])
        if not np.isfinite(found["loss"]) or found["nonfinite_gradients"] != 0:
            raise ValueError(f"a step is not finite: {found}")
        return found
