"""A training job: its slice of the config as an object, and what follows from it."""

import json
import math
from typing import Literal

from alignerf.experiment import schema
from alignerf.experiment.keys import model as model_keys
from alignerf.experiment.keys import training as training_keys
from alignerf.experiment.keys.key import Keys, key
from alignerf.files import faults
from alignerf.methods.align import Align
from alignerf.methods.refine import Refine
from alignerf.methods.staged import AligNeRF

STAGES = ("full", "warm", "pretrain", "finetune")
# Of a stage with a budget, however small that is; of a whole training, however large.
LEAST_STEPS, MOST_STEPS = 10, 10**8


class Finetuning(AligNeRF):
    """The settings of one method, with the file that its loss looks through."""

    radius_px: int | None = key(
        None, "null takes it from the measured misalignment", least=0, most=64
    )
    frequency_weights: str | None = key(None, "file that the loss looks through")

    @property
    def outputs(self):
        """Values that the field gives: without a convolution they are colours."""
        return self.features if self.convolution else 3


class Job(Keys):
    """All that decides what a training computes, besides scene and threads."""

    seed: int = key(least=0, most=2**32 - 1)
    stage: Literal[STAGES] = key()
    model: model_keys.Models = key()
    training: training_keys.Training = key()
    alignerf: Finetuning | None = key(None, "of a fine-tuning")
    pretrain_share: float | None = key(
        None, "of a pre-training: its share of the length", above=0, most=1
    )
    refine: Refine | None = key(None, "learns cameras too")
    align: Align | None = key(None, "aligns itself on the way")
    decisions: str | None = key(
        None,
        "file of what the scene's facts decided; `alignerf.decisions.fill` takes it",
    )

    @property
    def share(self):
        """Of the training's length that this stage has."""
        return {
            "full": 1.0,
            "warm": 1.0,
            "pretrain": self.pretrain_share,
            "finetune": self.alignerf and self.alignerf.finetune_share,
        }[self.stage]

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
        return self.steps if self.stage == "finetune" else self.training.steps

    @property
    def warmup_steps(self):
        """Steps of warm-up: the same share of every stage's schedule."""
        share = self.schedule_steps / self.training.steps
        return round(share * self.training.warmup_steps)

    @property
    def learning_rates(self):
        """First and last of this stage."""
        stage = self.alignerf if self.stage == "finetune" else self.training
        return stage.learning_rates

    @property
    def rays_per_step(self):
        if self.stage == "finetune":
            return self.alignerf.patches * self.alignerf.patch_px**2
        return self.training.batch_rays


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
    given, values = values, schema.filled(Job, values)
    training_keys.check_length(given["training"], "training")
    values["training"] |= values["model"].pop("training")
    values["model"]["training"] = {}
    values["training"] |= training_keys.length(values["training"])
    values["training"] |= training_keys.warmup(values["training"])
    if not values["training"]["learning_rates"]:
        rates = model_keys.rates_of(values["model"])
        values["training"]["learning_rates"] = rates
    job = schema.check(Job, values)
    if job.decisions:
        raise ValueError("config: decisions: they are not filled in")
    if job.training.decided or getattr(job.model, "decided", None):
        raise ValueError("config: decided: keys that are still left to facts")
    check_stage(job)
    if hasattr(job.model, "far") and job.model.near >= job.model.far:
        raise ValueError("config: model: near must be smaller than far")
    if job.align and (job.alignerf or job.refine or job.stage != "full"):
        raise ValueError("config: align: not beside alignerf, refine or another stage")
    others = job.alignerf or job.refine or job.pretrain_share
    if others and job.model.kind != "mipnerf360":
        raise ValueError(f"config: model.kind: {job.model.kind} has no such stage")
    return job


def check_stage(job: Job):
    """Each stage has its own keys, and no other has them."""
    for stage, name in (("pretrain", "pretrain_share"), ("finetune", "alignerf")):
        is_there = getattr(job, name) is not None
        if job.stage == stage and not is_there:
            raise ValueError(f"config: {name}: stage {stage!r} needs it")
        if job.stage != stage and is_there:
            raise ValueError(f"config: {name}: not in stage {job.stage!r}")
    chosen = job.alignerf
    if chosen and chosen.matching == "pixel" and chosen.radius_px == 0:
        raise ValueError("config: alignerf.radius_px: matching pixel needs 1 or more")


def in_stage(job: Job, stage) -> Job:
    """The same job in another stage."""
    return job.model_copy(update={"stage": stage})


def steps_in(job: Job, step_time_s) -> int:
    """Steps that the whole training's budget holds, at this stage's seconds a step."""
    fitting = round(60 * job.training.budget_min / step_time_s)
    least = math.ceil(LEAST_STEPS / job.share)
    return min(max(fitting, least), MOST_STEPS)


def with_steps(job: Job, steps) -> Job:
    """The job of a budget as one whose whole training has this many steps."""
    training = job.training.model_dump() | {"steps": steps}
    warmup_steps = min(training_keys.warmup(training)["warmup_steps"], steps)
    found = {"steps": steps, "warmup_steps": warmup_steps}
    training = job.training.model_copy(update=found)
    return job.model_copy(update={"training": training})


def as_dict(job: Job) -> dict:
    """JSON-able content of a job."""
    return job.model_dump()
