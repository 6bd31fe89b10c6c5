"""Pose optimization: the training learns its cameras with the scene, without flow."""

from typing import ClassVar

import pydantic

from alignerf.experiment import jobs
from alignerf.experiment.keys.key import Keys, key, learning_rates
from alignerf.methods import base


class PoseOptimization(Keys):
    """Poses optimized with the scene, as BARF and CamP do."""

    learning_rates: list[float] = learning_rates(0.001, 0.00001)
    delay_fraction: float = key(
        0.1, "of the steps before the cameras may move", least=0, most=0.99
    )
    preconditioned: bool = key(
        True, "turns and steps in units that move pixels alike, as CamP"
    )
    coarse_to_fine: list[float] | None = key(
        None,
        "shares of the steps between which the field's frequencies, or the levels of "
        "a grid, come in one by one; BARF's are 0.1 and 0.5; null: all from the start",
        least=0,
        most=1,
        length=(2, 2),
    )

    @pydantic.model_validator(mode="after")
    def check_shares(self):
        shares = self.coarse_to_fine
        if shares and not shares[0] < shares[1] < 1:
            raise ValueError("coarse_to_fine: two shares, first < last < 1")
        return self


class Job(jobs.Full):
    """A training that learns its cameras."""

    own: ClassVar = "pose_optimization"
    part: ClassVar = "alignerf.cameras.refine:Learning"
    moves: ClassVar = frozenset(["cameras"])
    pose_optimization: PoseOptimization = key()


class Learnt(base.Method):
    """A method with `pose_optimization`."""

    key, Keys, order = "pose_optimization", PoseOptimization, 4
    what = "the training views' cameras are learnt with the scene, without flow"
    beside = (*base.Method.beside, "adjust")
    systems = ("mipnerf360",)
    jobs = (Job,)

    def moves(self, method, round):
        return frozenset(["cameras"])

    def words(self, experiment, name):
        return ["poses optimized"]


METHOD = Learnt()
