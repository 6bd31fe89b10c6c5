"""Steps and renders that are compiled once for all trainings of a job in one process.

A training that is killed and goes on compiles the same programs again. They would come
from the cache on disk, to the bit, but only once they have been traced and lowered
anew: most of what so short a training takes. A job's method is kept too: JAX knows its
functions again, and with them fresh parameters.
"""

import jax

from alignerf.training import compose, program, renderer
from alignerf.training import step as train_step

_compiled, _methods, _renderers = {}, {}, {}


def use(patch):
    """Let trainings take the steps that are kept; patch: a MonkeyPatch."""
    make_step = train_step.make_step

    def make_kept(method, optimizer_of, **options):
        step = make_step(method, optimizer_of, **options)
        job = job_of(optimizer_of)
        if job is None:
            return step
        return Step(step, (method, identity(job), *sorted(options.items())))

    make_method = compose.make_method

    def make_kept_method(job, views=None, **options):
        if hangs_on_more(job):
            return make_method(job, views, **options)
        key = (identity(job), *sorted(options.items()))
        if key not in _methods:
            _methods[key] = make_method(job, views, **options)
        return _methods[key]

    make_renderer = renderer.Renderer

    def make_kept_renderer(method, width, height):
        # Methods are made of functions: equal if they are the same.
        key = (method, width, height)
        if key not in _renderers:
            _renderers[key] = make_renderer(*key)
        return _renderers[key]

    patch.setattr(train_step, "make_step", make_kept)
    patch.setattr(compose, "make_method", make_kept_method)
    patch.setattr(renderer, "Renderer", make_kept_renderer)


def forget():
    """Trace all anew, as another process would: what is traced may not differ."""
    for kept in (_compiled, _methods, _renderers):
        kept.clear()


def job_of(optimizer_of):
    """The job of a training; None where its step hangs on more than that."""
    if getattr(optimizer_of, "func", None) is not program.make_optimizer:
        return None
    (job,) = optimizer_of.args
    return None if hangs_on_more(job) else job


def identity(job):
    """What its method and step hang on; alignments come between steps."""
    return repr(job.model_copy(update={"align": None}))


def hangs_on_more(job):
    """Whether its method is made of more than the job: of cameras, or of a file."""
    return bool(job.refine or (job.alignerf and job.alignerf.frequency_weights))


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
