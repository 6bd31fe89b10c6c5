"""Adjust: trained as a plain method is, by cameras that bundle adjustment corrected.

With `alignerf`, `aligned_loss`, `align`, `pose_optimization` or `auto` beside it, that
one trains it, from such cameras.
"""

from alignerf.experiment import layout
from alignerf.experiment.keys import key as keys
from alignerf.methods import base


class Adjusted(base.Method):
    """A method with `adjust`."""

    key, order = "adjust", 1
    beside = (
        *base.Method.beside,
        *("alignerf", "aligned_loss", "align", "pose_optimization", "auto"),
    )
    annotation = bool
    example = "adjust: true"
    field = keys.key(
        False,
        "it trains with cameras that bundle adjustment has corrected, beside methods "
        "that train with the scene's; or beside alignerf, aligned_loss, align, "
        "pose_optimization or auto",
    )

    def cameras(self, experiment, scene):
        """Crops have the cameras of their scene; adjusted poses have them already."""
        chosen = experiment.scenes[scene]
        if experiment.parent(scene) or chosen.poses == "adjusted":
            return {}
        return {"cameras": layout.Scene(scene).adjusted_train}

    def moves(self, method, round):
        return frozenset(["cameras"])

    def words(self, experiment, name):
        return ["cameras adjusted"]


METHOD = Adjusted()
