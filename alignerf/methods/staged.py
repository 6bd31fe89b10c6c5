"""Staged: AligNeRF pre-trains as a plain method does, then fine-tunes by patches.

Methods of a model share the pre-training.
"""

from typing import ClassVar, Literal

from alignerf import methods
from alignerf.experiment import jobs, trainings
from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys.key import Keys, key, learning_rates
from alignerf.methods import base


class AligNeRF(Keys):
    """The three contributions and the two stages' shares of the steps."""

    pretrain_fraction: float = key(
        0.6, "of training.steps, as the baseline", above=0, most=1
    )
    finetune_fraction: float = key(
        0.2, "of training.steps, on patches", above=0, most=1
    )
    learning_rates: list[float] = learning_rates(0.003, 0.0003)
    patches: int = key(4, "patches a step", least=1, most=4096)
    patch_px: int = key(16, "side of a patch, in rays", least=8, most=512)
    convolution: bool = key(
        True, "contribution 1, patch convolution; false shows the model's colors"
    )
    features: int = key(16, "N of the patch convolution", least=3, most=1024)
    radius_px: int = key(
        8, "largest offset searched; 0 searches none", least=0, most=64
    )
    align_penalty: float = key(
        0.01,
        "lambda of Eq. 4: weight of the offset's length in px against the error summed "
        "over a patch",
        least=0,
        most=1e6,
    )
    frequency_weight: float = key(
        0.05,
        "contribution 3, w of the high-frequency loss; 0 has none",
        least=0,
        most=1e6,
    )


class Finetuning(AligNeRF):
    """The settings of one method, with the file that its loss looks through."""

    frequency_weights: str | None = key(None, "file that the loss looks through")

    @property
    def outputs(self):
        """Values that the field gives: without a convolution they are colours."""
        return self.features if self.convolution else 3


class Pretrain(jobs.Job):
    """The beginning of a training in one go."""

    stage: Literal["pretrain"] = key("pretrain")
    pretrain_fraction: float = key(what="of the length", above=0, most=1)

    @property
    def share(self):
        return self.pretrain_fraction


class Finetune(jobs.Job):
    """The second stage, on patches."""

    part: ClassVar = "alignerf.contributions.patch_losses:Part"
    stage: Literal["finetune"] = key("finetune")
    alignerf: Finetuning = key()

    @property
    def share(self):
        return self.alignerf.finetune_fraction

    @property
    def schedule_steps(self):
        return self.steps

    @property
    def learning_rates(self):
        return self.alignerf.learning_rates

    @property
    def rays_per_step(self):
        return self.alignerf.patches * self.alignerf.patch_px**2

    @property
    def weights(self):
        return self.alignerf.frequency_weights


class Staged(base.Method):
    """A method with `alignerf`."""

    key, Keys, order = "alignerf", AligNeRF, 2
    what = "staged training with the three contributions"
    beside = (*base.Method.beside, "adjust")
    systems = ("mipnerf360",)
    jobs = (Pretrain, Finetune)

    def check(self, config, name):
        """It has no rounds, and shares its pre-training with others of its model."""
        method, where = config.methods[name], f"methods.{name}"
        settings, model = method.alignerf, method.model
        for other, chosen in config.methods.items():
            theirs = chosen.model == model and chosen.alignerf
            if theirs and theirs.pretrain_fraction != settings.pretrain_fraction:
                what = f"methods.{other} has another, and {model} is pre-trained once"
                fault(f"{where}.alignerf.pretrain_fraction", what)

    def trainings(self, experiment, scene, name, once):
        """The fine-tuning, which the pre-training leads to."""
        method = experiment.methods[name]
        job = self.pretraining(experiment, scene, name)
        more = methods.input_cameras(experiment, scene, name)
        # No model's name has a point.
        folder = f"pretrain/{method.model}{'.adjusted' * bool(more)}"
        pretrained = once(trainings.from_photos(scene, folder, job, **more))
        job = self.finetuning(experiment, scene, name)
        more |= {"initial": pretrained.path.model, "after": (pretrained,)}
        return [once(trainings.from_photos(scene, f"{name}/round0", job, **more))]

    def pretraining(self, experiment, scene, name):
        """What methods share that differ in their fine-tuning."""
        share = experiment.methods[name].alignerf.pretrain_fraction
        job = trainings.common(experiment, scene, name)
        return Pretrain(**job, pretrain_fraction=share)

    def finetuning(self, experiment, scene, name):
        """All that AligNeRF adds, and the file that its loss looks through."""
        chosen = experiment.methods[name].alignerf
        weighs = chosen.frequency_weight > 0
        weights = experiment.config.frequency_weights if weighs else None
        settings = Finetuning(**dict(chosen), frequency_weights=weights)
        job = trainings.common(experiment, scene, name)
        return Finetune(**job, alignerf=settings)

    def words(self, experiment, name):
        """The contributions that the method has."""
        method = experiment.methods[name]
        settings = method.alignerf
        parts = [f"{settings.features} features"] * settings.convolution
        if settings.radius_px != 0:
            parts.append("aligned")
        if settings.frequency_weight > 0:
            weights = experiment.config.frequency_weights
            parts.append("VGG-19" if weights else "derivative bank")
        return parts


METHOD = Staged()
