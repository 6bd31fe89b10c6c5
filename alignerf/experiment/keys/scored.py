"""Keys of what is scored: the reference, and test sets and metrics beside the usual."""

from typing import Literal

from alignerf.experiment.keys.key import Keys, key


class Reference(Keys):
    method: str | None = key(
        None, "a key of methods; null takes the first that trains from scratch"
    )
    round: int | Literal["last"] = key(
        "last", "its warping round; `last` is the method's last one", least=0, most=16
    )


class AlignedPose(Keys):
    """The test set whose cameras are moved to fit their photos, half by half."""

    flow: bool = key(True, "by the flow from render to photo; false: no such test set")


class Lpips(Keys):
    alex: str | None = key(None, "AlexNet")
    squeeze: str | None = key(None, "SqueezeNet 1.1")
    vgg: str | None = key(None, "VGG-16")
