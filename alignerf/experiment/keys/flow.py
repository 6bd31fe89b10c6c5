"""Keys of `flow`: how photos and renders are matched and warped."""

from typing import Literal

from alignerf.experiment.keys import estimators
from alignerf.experiment.keys.key import Keys, key


class Flow(Keys):
    estimator: Literal[estimators.EVERY] = key(
        "deepflow",
        "optical flow, see flow/estimation/estimators.py; files reads flows made "
        "elsewhere from `folder`",
    )
    folder: str | None = key(
        None,
        "where estimator `files` finds <view>.flo or <view>.npz (render to photo) and, "
        "if there is a check to be made, <view>.back.flo or .npz; {scene}, {method}, "
        "{round} and {split} in it stand for the renders' own; after pre-training, "
        "where cameras are corrected then, {method} is pretrain and {round} the model",
    )
    match_blur: bool = key(
        True, "blur the photo like the render, for the estimate only"
    )
    blur_by: Literal[estimators.FAST] | None = key(
        None,
        "estimator by which that blur is found; null: the same; a fast one finds the "
        "same blur in a third of the time",
    )
    kernel: Literal["lanczos", "cubic", "bilinear"] = key(
        "lanczos", "interpolation of warps"
    )
    tolerance_px: float = key(
        1.0,
        "largest forward-backward disagreement of a valid pixel, in px",
        above=0,
        most=1000,
    )
