"""Keys of `flow`: how photos and renders are matched and warped."""

from typing import Literal

from alignerf.experiment.keys import estimators
from alignerf.experiment.keys.key import PATH, Keys, key


class Flow(Keys):
    estimator: Literal[(*estimators.EVERY, "files")] = key(
        "deepflow",
        "optical flow, see flow/estimation/estimators.py; files reads flows made "
        "elsewhere from `folder`",
    )
    folder: PATH | None = key(
        None,
        "where estimator `files` finds <view>.flo or <view>.npz (render to photo) and, "
        "if there is a check to be made, <view>.back.flo or .npz; {scene}, {method}, "
        "{round} and {split} in it stand for the renders' own",
    )
    match_blur: bool = key(
        True, "blur the photo like the render, for the estimate only"
    )
    blur_by: Literal[estimators.EVERY] | None = key(
        None,
        "estimator by which that blur is found; null: the same; a fast one finds the "
        "same blur in a third of the time",
    )
    tolerance_px: float = key(
        1.0,
        "largest forward-backward disagreement of a valid pixel, in px",
        above=0,
        most=1000,
    )

    def faults(self):
        if self.estimator == "files" and not self.folder:
            yield "", "'folder' is a required property of estimator 'files'"
        if self.folder and self.estimator != "files":
            yield "folder", f"estimator {self.estimator!r} reads none"
        # Plain names: format specifications and attributes could ask for anything.
        rest = self.folder or ""
        for name in ("scene", "method", "round", "split"):
            rest = rest.replace(f"{{{name}}}", "")
        if set(rest) & set("{}"):
            what = "in braces only scene, method, round and split have a meaning"
            yield "folder", f"{self.folder}: {what}"
