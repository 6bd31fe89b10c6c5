"""A toy loss: rays of the largest errors do not count, as in RobustNeRF."""

from typing import ClassVar

from alignerf.experiment import jobs
from alignerf.experiment.keys import key as keys
from alignerf.methods import base


class Trimmed(keys.Keys):
    """A trimmed loss: what only some photos show is left out."""

    share: float = keys.key(0.8, "of the rays, which count", above=0, most=1)


class Part(base.Part):
    def data_loss(self, rendering, photo, weight):
        import jax.numpy as jnp

        error = jnp.mean((rendering.values - photo) ** 2, axis=-1)
        weight *= error <= jnp.quantile(error, self.job.trimmed.share)
        return jnp.sum(error * weight) / jnp.maximum(jnp.sum(weight), 1e-6)


class Job(jobs.Full):
    own: ClassVar = "trimmed"
    part: ClassVar = f"{__name__}:Part"
    trimmed: Trimmed = keys.key()


class Method(base.Method):
    key, Keys, jobs = "trimmed", Trimmed, (Job,)

    def words(self, experiment, name):
        return ["trimmed loss"]


METHOD = Method()
