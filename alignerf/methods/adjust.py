"""Adjust: trained as a plain method is, by cameras that bundle adjustment corrected.

With `align` or `refine` beside it, that one trains it, and begins with such cameras.
"""

from alignerf.experiment import layout
from alignerf.experiment.checks.common import fault
from alignerf.experiment.keys import key as keys
from alignerf.methods import base


class Adjusted(base.Method):
    """A method with `adjust`."""

    key, order = "adjust", 3
    beside = (*base.Method.beside, "align", "refine")
    annotation = bool
    field = keys.key(
        False,
        "it trains with cameras that bundle adjustment has corrected, beside methods "
        "that train with the scene's; alone, or beside align or refine",
    )

    def check(self, config, name):
        for scene, chosen in config["scenes"].items():
            if chosen["zoom"] and not chosen["zoom"]["of"]:
                what = f"scenes.{scene} is of crops: give it poses: adjusted"
                fault(f"methods.{name}.adjust", what)

    def cameras(self, experiment, scene):
        """Crops have the cameras of their scene; adjusted poses have them already."""
        chosen = experiment.scenes[scene]
        if chosen["zoom"] or chosen["poses"] == "adjusted":
            return {}
        return {"cameras": layout.adjusted(scene, "train.npz")}

    def moves(self, method, round):
        return frozenset(["cameras"])

    def words(self, experiment, name):
        return ["cameras adjusted"]


METHOD = Adjusted()
