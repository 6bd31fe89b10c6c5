"""Keys of `training`: how the baseline is trained, and how long."""

from typing import Literal

import pydantic

from alignerf.experiment.keys.key import Keys, budget, given, key, left_to_facts, some

# What `decide` leaves to a scene's facts: `experiment.decisions` has a rule for it.
OPEN_OF_TRAINING = ("steps",)


class Training(Keys):
    """How the baseline is trained; the other stages start from it."""

    steps: int | None = key(
        4000, "steps of plain training; null with a budget_min", least=1, most=10**8
    )
    budget_min: float | None = budget(
        "minutes of plain training, instead of steps: the machine is timed at the "
        "start; each stage takes its fraction of the minutes"
    )
    batch_rays: int = key(512, "rays a step", least=1, most=2**22)
    learning_rates: list[float] | None = key(
        None,
        "first and last learning rate; null takes those of the model's kind, or of "
        "its field's",
        above=0,
        most=10,
        length=(2, 2),
    )
    warmup_steps: int | None = key(
        None,
        "steps of warm-up, a sine from 1 %; null: a tenth of the steps",
        least=0,
        most=10**8,
    )
    hold_fraction: float = key(
        0.5,
        "fraction of the steps before the learning rate falls; published: 0",
        least=0,
        most=0.99,
    )
    adam_betas: list[float] = key(
        [0.9, 0.99],
        "betas of Adam; published: 0.9 and 0.999",
        least=0,
        most=0.999999,
        length=(2, 2),
    )
    adam_eps: float = key(1e-15, "epsilon of Adam", above=0, most=1)
    gradient_norm: float | None = key(
        None,
        "largest norm of each network's gradient; null does not clip",
        above=0,
        most=1e9,
    )
    proposal_fraction: float = key(
        0.25,
        "fraction of a step's rays that teach the proposal field; published: 1",
        above=0,
        most=1,
    )
    interlevel_weight: float = key(
        1.0, "weight of the proposal field's loss", least=0, most=1e6
    )
    distortion_weight: float = key(
        0.01, "weight of mip-NeRF 360's distortion loss", least=0, most=1e6
    )
    kernels: Literal["auto", "native", "jax"] = key(
        "auto",
        "how a CPU computes grids and resampling: native, C++ kernels that are "
        "compiled once; jax, XLA's own code; auto: native where there is a compiler. "
        "Both agree to rounding",
    )
    decided: list[Literal[OPEN_OF_TRAINING]] = left_to_facts(*OPEN_OF_TRAINING)


def warmup(training):
    """The warm-up of a training, as a mapping, that may leave it to its steps.

    Null as long as its steps are not known.
    """
    given, steps = training["warmup_steps"], training["steps"]
    if given is None and steps is not None:
        given = round(0.1 * steps)
    return {"warmup_steps": given}


# Keys of `training` in which a model's trainings differ, but not in their budget. A
# job's training has taken them in, so that of a job nothing is left here.
SAME = {"budget_min"}
DIFFER = [name for name in Training.model_fields if name not in SAME]
Changes = given(
    pydantic.create_model("Changes", __base__=Keys, **some(Training, *DIFFER))
)


def check_length(given, where):
    """ValueError where a mapping as it was written has steps and a budget."""
    if given.get("steps") is not None and given.get("budget_min") is not None:
        raise ValueError(f"config: {where}.budget_min: not beside steps, choose one")


def length(training):
    """What decides how long a training is, of a mapping with defaults: one is null."""
    steps, budget_min = training["steps"], training["budget_min"]
    if steps is None and budget_min is None:
        raise ValueError("config: training.steps: null is only for a budget_min")
    steps = steps if budget_min is None else None
    return {"steps": steps, "budget_min": budget_min}
