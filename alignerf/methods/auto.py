"""Auto: cameras corrected by flow, then learnt, where the flow says they are wrong."""

from typing import ClassVar, Literal

from alignerf.experiment import jobs
from alignerf.experiment.keys.key import key
from alignerf.methods import align, pose_optimization

# Chosen on validation seeds of the courtyard (docs/measured/learnt_choices.csv).
# Flow takes what is large at once; what it leaves is learnt from colours. Photos warped
# besides brought nothing.
LEARNS = pose_optimization.PoseOptimization()
ALIGNS = align.Align(cameras_at=[LEARNS.delay_fraction], photos_at=[])


class Job(jobs.Full):
    """A training that corrects its cameras once, and then learns them for a while."""

    own: ClassVar = "auto"
    part: ClassVar = align.Job.part
    moves: ClassVar = frozenset(["cameras"])
    aligns: ClassVar = ALIGNS
    learns: ClassVar = LEARNS
    auto: Literal[True] = key()


class Automatic(align.Aligned):
    """A method with `auto`."""

    key, Keys, order = "auto", None, 6
    systems = pose_optimization.METHOD.systems
    annotation = bool
    example = "auto: true"
    what = "one look by flow; where cameras are wrong, they are corrected, then learned"
    jobs = (Job,)

    @property
    def field(self):
        return key(False, self.what)

    def moves(self, method, round):
        return Job.moves

    def words(self, experiment, name):
        return ["cameras corrected, then learned"]


METHOD = Automatic()
