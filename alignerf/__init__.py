"""AligNeRF (CVPR 2023) and its baseline mip-NeRF 360 in JAX.

The files here are the stages, commands that one rule of the workflow or several run:
`config`, `poses`, `facts`, `train`, `render_views`, `correct_poses`,
`align_test_poses`, `evaluate`, `tabulate`, `export`; and one for users, `show`.

The paper's parts -> folders:

baseline, mip-NeRF 360          `mipnerf360`, and what maps a point to values, `fields`
its three contributions         `contributions`: patch_conv, align_loss, frequency_loss
staged training                 `training`
misalignment analysis           the package `flow`
learning poses (CamP, BARF)      `cameras`
Tables 1 and 4, their controls  `tables`: misalignment, controls, ranking, effects, ...
PSNR, SSIM, LPIPS               `metrics`, on `networks` with published weights
photos, cameras, views          `scenes`; others' files `readers`; poses `colmap`, `sfm`
the embedded scene, its truth   `courtyard`
photos and renders of others    `judged`
what other programs are given   `exports`

other programs' renders         `diagnose`, in `api`, for Python and notebooks

`experiment` says what a config means, without JAX: the jobs, what each job depends on,
and what it asks of a cluster. `processes` shares a step between devices. `io` is what
all commands share: errors in one line, and atomic outputs.
"""

import importlib
import os
import sys
from typing import TYPE_CHECKING, Any

from alignerf.io.environment import interrupts, switches

if TYPE_CHECKING:
    from alignerf.api.diagnosis import Cause, Report, diagnose

    __version__: str

# What `import alignerf` offers to a program of the user's, imported when it is asked
# for.
__all__ = ("Cause", "Report", "__version__", "diagnose")

# What Python says while it looks for the command of `python -m alignerf.train`, and the
# command that is installed: before anything imports JAX.
if {*map(os.path.basename, sys.argv[:1])} & {"-m", "why-blurry"}:
    interrupts.begin()
    switches.settle()


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name == "__version__":
        return importlib.import_module("alignerf.io.provenance").VERSION
    return getattr(importlib.import_module("alignerf.api.diagnosis"), name)
