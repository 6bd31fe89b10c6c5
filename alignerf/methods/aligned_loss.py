"""Aligned loss: AligNeRF's alignment-aware loss alone, in one training of any model."""

from typing import ClassVar

from alignerf.experiment import jobs
from alignerf.experiment.keys.key import Keys, key
from alignerf.methods import base

# What a step that searches the photos takes besides, of a plain step: courtyard at
# 200x150 px on a CPU.
MORE_TIME = 0.25


class AlignedLoss(Keys):
    """The alignment-aware loss on single rays, where photos ask for it."""

    start_fraction: float = key(
        0.3,
        "fraction of the steps before the one look that says whether photos are "
        "searched from there on",
        above=0,
        most=0.99,
    )
    min_move_px: float = key(
        0.4,
        "median offset of photo and render at the look, in px, below which the "
        "training stays plain",
        least=0,
        most=100,
    )
    radius_px: int = key(8, "largest offset searched", least=1, most=64)
    patch_px: int = key(
        100, "side of the parts of a photo that have one offset each", least=8, most=512
    )
    patch_rays: int = key(
        256,
        "an offset's cost is the squared error of a part's last so many rays, over "
        "several steps",
        least=16,
        most=65536,
    )
    align_penalty: float = key(
        0.01, "lambda of Eq. 4, against the sum over patch_rays", least=0, most=1e6
    )


class Job(jobs.Full):
    """A training with the loss."""

    own: ClassVar = "aligned_loss"
    part: ClassVar = "alignerf.alignment.loss:Part"
    aligned_loss: AlignedLoss = key()

    @property
    def mean_step(self):
        return 1 + MORE_TIME * (1 - self.aligned_loss.start_fraction)


class Aligned(base.Method):
    """A method with `aligned_loss`."""

    key, Keys, order = "aligned_loss", AlignedLoss, 3
    what = "one training with AligNeRF's alignment-aware loss, in any model"
    beside = (*base.Method.beside, "adjust")
    jobs = (Job,)

    def words(self, experiment, name):
        return ["aligned loss"]


METHOD = Aligned()
