"""A training job: its slice of the config as an object, and what follows from it.

A job has a class of its own for each stage, and for each method that changes a whole
training (`jobs` of `methods.base.Method`).
"""

import functools
import json
import math
from typing import ClassVar, Literal

from alignerf import methods
from alignerf.experiment import schema
from alignerf.experiment.keys import model as model_keys
from alignerf.experiment.keys import training as training_keys
from alignerf.experiment.keys.key import Keys, key
from alignerf.io import faults, json_files

# Of a stage with a budget, however small that is; of a whole training, however large.
MIN_STEPS, MAX_STEPS = 10, 10**8


class Text:
    """A job's JSON, by which jobs are compared."""

    @functools.cached_property
    def text(self):
        return json_files.canonical(self.model_dump())

    def __eq__(self, other):
        return type(self) is type(other) and self.text == other.text

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


def read(text):
    """A stage's slice of the config: a JSON object, or the path of a file of one."""
    if not text.lstrip().startswith("{"):
        text = faults.text(text)
    try:
        found = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"--config is not JSON: {error}") from None
    if not isinstance(found, dict):
        raise ValueError("--config must be a JSON object")
    return found


def parse(values) -> Job:
    """The job of a training or rendering, checked as a whole; defaults are filled."""
    values = {key: value for key, value in values.items() if value is not None}
    kind = class_of(values)
    given, values = values, schema.filled(kind, values)
    training_keys.check_length(given["training"], "training")
    values["training"] |= values["model"].pop("training")
    values["model"]["training"] = {}
    values["training"] |= training_keys.length(values["training"])
    values["training"] |= training_keys.warmup(values["training"])
    if not values["training"]["learning_rates"]:
        rates = model_keys.system_of(values["model"]).rates
        values["training"]["learning_rates"] = list(rates)
    job = schema.check(kind, values)
    if job.decisions or job.training.decided or getattr(job.model, "decided", None):
        raise ValueError("config: decisions: they are not filled in")
    for name, reason in job.model.faults():
        raise ValueError(f"config: model.{name}: {reason}".replace(".:", ":"))
    return job


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
    training = job.training.model_dump() | {"steps": steps}
    warmup_steps = min(training_keys.warmup(training)["warmup_steps"], steps)
    found = {"steps": steps, "warmup_steps": warmup_steps}
    return job.changed(training=job.training.model_copy(update=found))


def as_dict(job: Job) -> dict:
    """JSON-able content of a job."""
    return job.model_dump()
