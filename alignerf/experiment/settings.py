"""A training job's slice of the config as dataclasses, and the method it names.

`workflow/schemas/config.schema.yaml` gives every key's unit, range and meaning; a
test keeps both equal. Values arrive as JSON, already validated.
"""

import dataclasses
import json
import types
import typing
from pathlib import Path

MOST_ROUNDS = 4
COURTYARD_MOTION = {"motion": "uniform", "motion_m": 0.02}


class Source(typing.NamedTuple):
    """Where images and cameras come from."""

    poses: tuple  # the ways in which it can have poses, the default first
    has_truth: bool = False


SOURCES = {
    "courtyard": Source(("colmap", "truth"), has_truth=True),
    "photos": Source(("colmap",)),
    "transforms": Source(("given",)),
    "llff": Source(("given",)),
}
STAGES = ("full", "warm", "pretrain", "finetune")
MATCHINGS = ("patch", "pixel")
ERRORS = ("squared", "charbonnier")


@dataclasses.dataclass(frozen=True)
class Model:
    """A model: how rays are sampled, and the two fields."""

    near: float
    far: float
    samples: list
    proposal: dict
    field: dict


@dataclasses.dataclass(frozen=True)
class Training:
    """How the baseline is trained; the other stages start from it."""

    steps: int
    batch_rays: int
    learning_rates: list
    warmup_steps: int
    adam_eps: float
    gradient_norm: float | None
    interlevel_weight: float
    distortion_weight: float


@dataclasses.dataclass(frozen=True)
class AligNeRF:
    """The three contributions and the two stages' shares of the steps."""

    pretrain_share: float
    finetune_share: float
    learning_rates: list
    patches: int
    patch_px: int
    convolution: bool
    features: int
    matching: str
    error: str
    radius_px: int | None  # None: from the measured misalignment
    align_penalty: float
    frequency_weight: float
    frequency_weights: str | None

    @property
    def outputs(self):
        """Values that the field gives: without a convolution they are colours."""
        return self.features if self.convolution else 3


@dataclasses.dataclass(frozen=True)
class Job:
    """All that decides what a training computes, besides scene and threads."""

    seed: int
    stage: str
    model: Model
    training: Training
    alignerf: AligNeRF | None

    @property
    def steps(self):
        """Steps of this stage."""
        share = {
            "full": 1.0,
            "warm": 1.0,
            "pretrain": self.alignerf and self.alignerf.pretrain_share,
            "finetune": self.alignerf and self.alignerf.finetune_share,
        }[self.stage]
        return max(1, round(share * self.training.steps))

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


def parse(kind, values, *, where="config"):
    """A dataclass from a mapping: every key known, every value of its type."""
    hints = typing.get_type_hints(kind)
    if not isinstance(values, dict):
        raise ValueError(f"{where}: must be a mapping, not {values!r}")
    if unknown := values.keys() - hints.keys():
        raise ValueError(f"{where}: unknown key {sorted(unknown)[0]!r}")
    if missing := hints.keys() - values.keys():
        raise ValueError(f"{where}: key {sorted(missing)[0]!r} is missing")
    return kind(
        **{
            key: _typed(hint, values[key], f"{where}.{key}")
            for key, hint in hints.items()
        }
    )


def _typed(hint, value, where):
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    if value is None and type(None) in options:
        return None
    (kind,) = (option for option in options if option is not type(None))
    if dataclasses.is_dataclass(kind):
        return parse(kind, value, where=where)
    accepted = (int, float) if kind is float else kind
    if isinstance(value, bool) != (kind is bool) or not isinstance(value, accepted):
        raise ValueError(f"{where}: must be {kind.__name__}, not {value!r}")
    return float(value) if kind is float else value


def parse_job(values) -> Job:
    """The job of a training or rendering, checked as a whole."""
    job = parse(Job, values)
    if job.stage not in STAGES:
        raise ValueError(f"config.stage: {job.stage!r} is not one of {STAGES}")
    if job.stage in ("pretrain", "finetune") and job.alignerf is None:
        raise ValueError("config.alignerf: a staged training needs it")
    if job.alignerf:
        for key, known in (("matching", MATCHINGS), ("error", ERRORS)):
            value = getattr(job.alignerf, key)
            if value not in known:
                raise ValueError(
                    f"config.alignerf.{key}: {value!r} is not one of {known}"
                )
        if job.alignerf.matching == "pixel" and job.alignerf.radius_px == 0:
            raise ValueError(
                "config.alignerf.radius_px: matching pixel needs 1 or more"
            )
    if not 0 < job.model.near < job.model.far < float("inf"):
        raise ValueError(
            f"config.model: near {job.model.near} and far {job.model.far} must be "
            "finite and 0 < near < far"
        )
    return job


def replace_stage(job: Job, stage) -> Job:
    """The same job in another stage."""
    return dataclasses.replace(job, stage=stage)


def as_dict(job: Job) -> dict:
    """JSON-able content of a job."""
    return dataclasses.asdict(job)


def read_config(text):
    """A stage's slice of the config: a JSON object, or the path of a file of one."""
    if not text.lstrip().startswith("{"):
        text = Path(text).read_text(encoding="utf-8")
    try:
        config = json.loads(text)
    except json.JSONDecodeError as error:
        raise ValueError(f"--config is not JSON: {error}") from None
    if not isinstance(config, dict):
        raise ValueError("--config must be a JSON object")
    return config
