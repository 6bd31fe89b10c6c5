"""Align: the training puts its cameras and photos right while it runs."""

from typing import ClassVar, Literal

from alignerf import methods
from alignerf.captures import base as captures
from alignerf.experiment import jobs
from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys import estimators
from alignerf.experiment.keys.key import Keys, key
from alignerf.methods import base

CHANGED = ("cameras", "photos")


class Align(Keys):
    """In-loop alignment: where one training stops, and what it corrects there."""

    cameras_at: list[float] = key(
        [0.15, 0.35],
        "fractions of the steps at which the training cameras are corrected",
        above=0,
        most=0.99,
        length=(0, 16),
    )
    photos_at: list[float] = key(
        [0.35],
        "fractions of the steps at which photos are warped, after the cameras, by flow "
        "that no moved camera explains",
        above=0,
        most=0.99,
        length=(0, 16),
    )
    shrink: int = key(
        3,
        "renders and photos are made smaller by at most this factor for the flow; less "
        "where the estimator would have too few pixels a side",
        least=1,
        most=16,
    )
    min_move_px: float = key(
        0.12,
        "cameras stay where the median one would move by less, in px of the small "
        "renders; more early in the training, less once cameras were seen to be wrong",
        least=0,
        most=100,
    )
    estimator: Literal[estimators.EVERY] = key(
        "deepflow", "optical flow, see `flow.estimator`"
    )

    def faults(self):
        if not (self.cameras_at or self.photos_at):
            yield "", "cameras_at or photos_at: it needs a share at which to align"


def places(align: Align, steps, where="align") -> dict:
    """{step: what is corrected before it} of a training that aligns itself.

    Steps count from 0; cameras come before photos. Raises ValueError, with the key as
    `where` begins it, where two shares of one list fall on one step, or one on the
    first or beyond the last.
    """
    found = {}
    for what in CHANGED:
        key = f"{what}_at"
        for share in sorted(getattr(align, key)):
            step = round(share * steps)
            changed = found.setdefault(step, [])
            outside = {0: "the first", steps: "beyond the last"}
            if what in changed or step in outside:
                which = outside.get(step, f"number {step}, as another is")
                raise ValueError(
                    f"config: {where}.{key}: {share:g} of {steps} steps is {which}"
                )
            changed.append(what)
    return dict(sorted(found.items()))


class Job(jobs.Full):
    """A training that aligns itself."""

    own: ClassVar = "align"
    part: ClassVar = "alignerf.alignment.aligner:InLoop"
    align: Align = key()

    @property
    def aligns(self):
        return self.align

    @property
    def moves(self):
        return frozenset(n for n in CHANGED if getattr(self.align, f"{n}_at"))


class Aligned(base.Method):
    """A method with `align`."""

    key, Keys, order = "align", Align, 5
    what = "in-loop alignment: the training corrects what it learns from"
    beside = (*base.Method.beside, "adjust")
    in_loop = True
    jobs = (Job,)

    def check(self, config, name):
        """A plain method says what it brought; its places are steps of their own."""
        method, where = config.methods[name], f"methods.{name}.{self.key}"
        model, others = method.model, config.methods.values()
        if not methods.has_scratch(others, model):
            what = f"another method of model {model!r} without {self.key}"
            fault(where, f"it needs {what}, to say what it brought")
        if not self.Keys:
            return
        own = [s for s in config.scenes.values() if not captures.of(s).parent(s)]
        for steps in {scene.steps for scene in own if scene.steps}:
            places(method.align, steps, where)

    def moves(self, method, round):
        return frozenset(key for key in CHANGED if getattr(method.align, f"{key}_at"))

    def words(self, experiment, name):
        moved = self.moves(experiment.methods[name], 0)
        return [f"{' and '.join(sorted(moved))} aligned in the loop"]


METHOD = Aligned()
