"""A training job: its slice of the config as an object, and what follows from it.

A job has a class of its own for each stage, and for each method that changes a whole
training (`jobs` of `methods.base.Method`).
"""

import functools
import math
from typing import ClassVar, Literal

from alignerf import methods
from alignerf.experiment import decisions, schema
from alignerf.experiment.keys import model as model_keys
from alignerf.experiment.keys import training as training_keys
from alignerf.experiment.keys.key import Keys, key
from alignerf.io import faults, json_files

# Of a stage with a budget, however small that is; of a whole training, however large.
MIN_STEPS, MAX_STEPS = 10, 10**8


class Text:
    """A job's canonical JSON: equal jobs have equal text."""

    @functools.cached_property
    def text(self):
        return json_files.canonical(self.model_dump())

    def __hash__(self):
        return hash(self.text)

    def changed(self, **fields):
        """The job with other values of these fields."""
        made = self.model_copy(update=fields)
        made.__dict__.pop("text", None)
        return made


class Job(Text, Keys):
    """All that decides what a training computes, besides scene and threads.

    own: the key by which a job of its stage is of this class. part: `module:class` of
    what it adds to a training (`methods.base.Part`). aligns: its settings of alignments
    in the loop. learns: those of cameras that are learnt with the scene. weights: the
    file that its loss looks through. moves: what it changes while it runs: `cameras`,
    `photos`.
    """

    own: ClassVar = None
    part: ClassVar = None
    aligns: ClassVar = None
    learns: ClassVar = None
    weights: ClassVar = None
    moves: ClassVar = frozenset()
    ours: ClassVar = True

    seed: int = key(least=0, most=2**32 - 1)
    model: model_keys.Models = key()
    training: training_keys.Training = key()
    decisions: str | None = key(
        None,
        "file of what the scene's facts decided, which `experiment.decisions` fills in",
    )
    scaled: bool = key(
        False, "its steps are times what the facts decided, over the usual steps"
    )

    @property
    def share(self):
        """Of the training's length that this stage has."""
        return 1.0

    @property
    def budget_min(self):
        """Minutes of this stage; None where steps are given."""
        whole = self.training.budget_min
        return None if whole is None else self.share * whole

    @property
    def steps(self):
        """Steps of this stage; with a budget they are known `with_steps`."""
        return max(1, round(self.share * self.training.steps))

    @property
    def schedule_steps(self):
        """Steps that the learning rate falls over: pre-training is a beginning."""
        return self.training.steps

    @property
    def warmup_steps(self):
        """Steps of warm-up: the same share of every stage's schedule."""
        share = self.schedule_steps / self.training.steps
        return round(share * self.training.warmup_steps)

    @property
    def learning_rates(self):
        """First and last of this stage."""
        return self.training.learning_rates

    @property
    def rays_per_step(self):
        return self.training.batch_rays

    @property
    def mean_step(self):
        """Mean time of a step in plain steps, as if what it corrects were wrong."""
        return self.learns.mean_step if self.learns else 1.0


class Full(Job):
    """A training in one go."""

    stage: Literal["full"] = key("full")


def read(text) -> Job:
    """The job of a JSON object, or of its file, with the decided settings."""
    return parse(fill(json_files.of_config(text)))


def fill(values):
    """A job's mapping whose open keys are filled from its decisions.json.

    A stage that takes a share of the steps takes the same share of those decided, and
    a warm-up of its own keeps its share. Raises ValueError where the file is missing,
    or does not say what the job needs.
    """
    path = values.get("decisions")
    if not path:
        return values
    known, job = decisions.read(path), schema.check(class_of(values), values)
    found = {name: decisions.one(known, name, path).value for name in job.model.open}
    if "near" in found:
        # A config may say how far it sees.
        found["near"] = min(found["near"], job.model.far / 2)
    training = job.training
    if job.scaled:
        steps = decisions.one(known, "steps", path).value
        times = steps / training_keys.USUAL_STEPS
        lengths = {"steps": training.steps, "warmup_steps": training.warmup_steps}
        lengths = {k: v and max(1, round(times * v)) for k, v in lengths.items()}
        training = training.model_copy(update=lengths)
    decided = {"model": job.model.closed(found), "training": training}
    return values | decided | {"decisions": None, "scaled": False}


def parse(values) -> Job:
    """The job of a training or rendering, checked as a whole; defaults are filled."""
    values = {key: value for key, value in values.items() if value is not None}
    job = schema.check(class_of(values), values)
    if job.decisions:
        raise ValueError("config: decisions: they are not filled in")
    training = job.training.model_copy(update=job.model.training.given)
    found = {
        "steps": training.whole,
        "warmup_steps": training.warmup(training.whole),
        "learning_rates": training.learning_rates or [*job.model.rates],
    }
    none = {"training": training_keys.Changes()}
    model = job.model.closed({}).model_copy(update=none)
    return job.changed(model=model, training=training.model_copy(update=found))


def class_of(values):
    """The class of a job's mapping, by its stage and by its methods' own keys."""
    every = [Full, *(one for record in methods.every() for one in record.jobs)]
    stages = {one.default("stage"): one for one in every if one.own is None}
    own = [one for one in every if one.own and one.own in values]
    # A list, as what is no text may have no hash.
    if values.get("stage") not in [*stages]:
        given = faults.shown(values.get("stage"), 100)
        raise ValueError(f"config: stage: {given} is none of {[*stages]}")
    return own[0] if own else stages[values["stage"]]


def plain(job: Job) -> Full:
    """The training in one go by a job's model and settings."""
    return Full(seed=job.seed, model=job.model, training=job.training)


def steps_in(job: Job, step_time_s) -> int:
    """Steps that the whole training's budget holds, at this stage's seconds a step."""
    fitting = round(60 * job.training.budget_min / step_time_s)
    least = math.ceil(MIN_STEPS / job.share)
    return min(max(fitting, least), MAX_STEPS)


def with_steps(job: Job, steps) -> Job:
    """The job of a budget as one whose whole training has this many steps."""
    found = {"steps": steps, "warmup_steps": min(job.training.warmup(steps), steps)}
    return job.changed(training=job.training.model_copy(update=found))
