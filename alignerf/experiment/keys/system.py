"""What the keys of every system have in common: a model that says its kind."""

from typing import ClassVar

import pydantic

from alignerf.experiment.keys.key import Keys, key


def changes():
    """The key `training` of a model, of type `keys.training.Changes`."""
    what = "keys of `training` that are others for this model; not steps or budget"
    return key({}, what)


class System(Keys):
    """A model of another kind than mip-NeRF 360; its `kind` is the name of that.

    RATES: of another package's, first and last learning rate where a config names none;
    the program's own stand in `keys.training`. HAS_NO: keys of a
    training that do nothing for it. NETWORKS: how many of its size it has.
    """

    model_config = pydantic.ConfigDict(json_schema_extra={"required": ["kind"]})
    RATES: ClassVar = (0.001, 0.0001)
    HAS_NO: ClassVar = ("interlevel_weight", "distortion_weight", "proposal_share")
    NETWORKS: ClassVar = 1

    @property
    def points_a_ray(self):
        """Points of a ray that all its networks see in a training."""
        return sum(self.samples)
