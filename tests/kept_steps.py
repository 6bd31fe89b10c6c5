"""Steps that are compiled once for all trainings of a job in one process.

A training that is killed and goes on compiles the same program again. It would come
from the cache on disk, to the bit, but only once it has been traced and lowered anew:
most of what so short a training takes.
"""

import jax

from alignerf.training import program
from alignerf.training import step as train_step

_compiled = {}


def use(patch):
    """Let trainings take the steps that are kept; patch: a MonkeyPatch."""
    make_step = train_step.make_step

    def make_kept(method, optimizer_of, **options):
        step = make_step(method, optimizer_of, **options)
        job = job_of(optimizer_of)
        if job is None:
            return step
        return Step(step, (repr(job), *sorted(options.items())))

    patch.setattr(train_step, "make_step", make_kept)


def job_of(optimizer_of):
    """The job of a training; None where its step hangs on more than that."""
    if getattr(optimizer_of, "func", None) is not program.make_optimizer:
        return None
    (job,) = optimizer_of.args
    looks_through = job.alignerf and job.alignerf.frequency_weights
    return None if job.refine or looks_through else job


class Step:
    """A jitted step, as far as a training asks: `step.lower(*shapes).compile()`."""

    def __init__(self, step, key):
        self.step, self.key = step, key

    def lower(self, *shapes):
        leaves, structure = jax.tree.flatten(shapes)
        self.key = (*self.key, structure, *map(str, leaves))
        self.shapes = shapes
        return self

    def compile(self):
        if self.key not in _compiled:
            _compiled[self.key] = self.step.lower(*self.shapes).compile()
        return _compiled[self.key]
