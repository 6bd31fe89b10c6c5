"""Keys of `training`: how the baseline is trained, and how long."""

from typing import Literal

from alignerf.experiment.keys.key import ONE_LENGTH, Keys, budget, key

USUAL_STEPS = 4000


class Changes(Keys):
    """Keys of `training` in which a model's trainings may differ: those given count."""

    steps: int | None = key(
        None,
        f"steps of plain training; null: {USUAL_STEPS}, or what `decide` makes of it",
        least=1,
        most=10**8,
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


class Training(Changes):
    """How the baseline is trained; the other stages start from it."""

    budget_min: float | None = budget(
        "minutes of plain training, instead of steps: the machine is timed at the "
        "start; each stage takes its fraction of the minutes"
    )

    def faults(self):
        if self.steps and self.budget_min:
            yield ONE_LENGTH

    @property
    def whole(self):
        """Its steps, the usual ones where they are open; None with a budget."""
        return None if self.budget_min else self.steps or USUAL_STEPS

    def warmup(self, steps):
        """Steps of warm-up of so many; null where neither are known."""
        if self.warmup_steps is None and steps is not None:
            return round(0.1 * steps)
        return self.warmup_steps
