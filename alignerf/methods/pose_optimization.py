"""Pose optimization: the training learns its cameras with the scene, by photometry."""

from typing import ClassVar

from alignerf.experiment import jobs
from alignerf.experiment.keys.key import Keys, key, learning_rates
from alignerf.methods import align, base

# Of the steps: renders before are too blurred for a look.
MIN_LOOK = 0.1
# What a step that learns the cameras takes besides, of a plain step.
MORE_TIME = 0.25


class PoseOptimization(Keys):
    """Poses optimized with the scene, as BARF and CamP do."""

    learning_rates: list[float] = learning_rates(0.08, 0.0008)
    delay_fraction: float = key(
        0.2, "fraction of the steps before cameras move", least=0, most=0.99
    )
    end_fraction: float = key(
        0.6,
        "fraction of the steps after which they stay, and cost no more",
        above=0,
        most=1,
    )
    min_move_px: float | None = key(
        0.12,
        "as in align, by a look at the first of these steps: where the median camera "
        "would move by less, none is optimized; null: no look",
        least=0,
        most=100,
    )
    prior_weight: float = key(
        0.00045,
        "weight in the loss of the mean square of rotations and translations: keeps "
        "cameras near the input ones",
        least=0,
        most=1e6,
    )
    preconditioned: bool = key(
        True,
        "rotations and translations in units that move pixels by 1 px, as CamP; else "
        "in radians and units of cameras.npz, which need other learning_rates",
    )
    coarse_to_fine: list[float] | None = key(
        None,
        "fractions of the steps between which the field's frequencies, or a grid's "
        "levels, come in one by one; BARF's are 0.1 and 0.5; null: all at once",
        least=0,
        most=1,
        length=(2, 2),
    )

    @property
    def mean_step(self):
        """Times a plain step: the mean step of a training whose cameras are wrong."""
        return 1 + MORE_TIME * (self.end_fraction - self.delay_fraction)

    def faults(self):
        if self.end_fraction <= self.delay_fraction:
            default = self.default("end_fraction")
            yield "end_fraction", f"not after the delay ({default} if none)"
        if self.min_move_px is not None and self.delay_fraction < MIN_LOOK:
            what = f"before {MIN_LOOK} of the steps a look tells nothing"
            yield "delay_fraction", f"{what}: with min_move_px: null there is none"
        shares = self.coarse_to_fine
        if shares and not shares[0] < shares[1] < 1:
            yield "coarse_to_fine", "two shares, first < last < 1"


class Job(jobs.Full):
    """A training that learns its cameras."""

    own: ClassVar = "pose_optimization"
    part: ClassVar = align.Job.part
    moves: ClassVar = frozenset(["cameras"])
    pose_optimization: PoseOptimization = key()

    @property
    def aligns(self):
        """It looks once, or never, and moves nothing by what it sees."""
        looks = {"cameras_at": [], "photos_at": []}
        if self.learns.min_move_px is not None:
            looks["min_move_px"] = self.learns.min_move_px
        return align.Align().model_copy(update=looks)

    @property
    def learns(self):
        return self.pose_optimization


class Learnt(base.Method):
    """A method with `pose_optimization`."""

    key, Keys, order = "pose_optimization", PoseOptimization, 4
    what = "the training views' cameras are learned with the scene, if they are wrong"
    beside = (*base.Method.beside, "adjust")
    systems = ("mipnerf360",)
    jobs = (Job,)

    def moves(self, method, round):
        return frozenset(["cameras"])

    def words(self, experiment, name):
        return ["poses optimized"]


METHOD = Learnt()
