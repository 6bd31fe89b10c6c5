"""Whether another round is worth its training: `python -m flow.rounds`.

What remains after a round of warping is the flow from its renders to the photos that it
learnt from: those were warped by the flow of the round before, so it is the difference
of the two flows (of round 0, the flow itself). Where its median no longer falls,
another round would repeat this one. The flow to the photos as taken cannot tell:
sharper renders show more of a misalignment that stays, and that flow grows.

What remains after a round that put cameras right is the correction that another such
round would train with.
"""

import json
import sys
from pathlib import Path

import numpy as np

from alignerf.io import atomic, faults, json_files
from flow.warping import files

# A smaller share is within what a training's random numbers change.
MIN_FALL = 0.1


def remaining_px(flow, before=None):
    """Mean over views of the median length of what remains, in pixels.

    flow, before: folders of <view>.npz of one round and the one before. Pixels count
    where both are valid. Raises ValueError naming a file.
    """
    paths = sorted(Path(flow).glob("*.npz"))
    if not paths:
        raise ValueError(f"{flow}: no flow (*.npz)")
    medians = []
    for path in paths:
        flow_px, valid = files.read_flow(path)
        if before is not None:
            other = Path(before) / path.name
            before_px, before_valid = files.read_flow(other)
            if before_px.shape != flow_px.shape:
                raise ValueError(f"{other}: another size than {path}")
            flow_px, valid = flow_px - before_px, valid & before_valid
        if not valid.any():
            raise ValueError(f"{path}: no valid pixel, so nothing is known to remain")
        medians.append(np.median(np.linalg.norm(flow_px[valid], axis=-1)))
    return float(np.mean(medians))


def decide(now_px, before_px=None, *, min_fall=MIN_FALL):
    """(whether to go on, why) by what remains after this round and the one before."""
    if now_px == 0:
        return False, f"{now_px:.3f} px remain to be corrected"
    if before_px is None:
        return True, f"{now_px:.3f} px remain to be corrected"
    fall = (before_px - now_px) / before_px if before_px > 0 else 0.0
    goes_on = fall >= min_fall
    negation = "" if goes_on else "not "
    return goes_on, (
        f"{now_px:.3f} px remain, {before_px:.3f} px before: "
        f"the least fall of {min_fall:.0%} is {negation}reached"
    )


def read_number(path, key):
    """A number of a JSON file. Raises ValueError naming the file."""
    return float(json_files.read(path, {key: json_files.NUMBER})[key])


def main(out, *, flow=None, before_flow=None, corrections=None, before=None):
    """Write {go_on, reason, remaining_px} as JSON. Raises ValueError or OSError."""
    if (flow is None) == (corrections is None):
        raise ValueError("either --flow or --corrections")
    if flow and (before is None) != (before_flow is None):
        raise ValueError("--before and --before-flow go together")
    if corrections:
        now_px = read_number(corrections, "correction_px")
    else:
        now_px = remaining_px(flow, before_flow)
    goes_on, reason = decide(now_px, before and read_number(before, "remaining_px"))
    decision = {"go_on": goes_on, "reason": reason, "remaining_px": now_px}
    with atomic.replace_file(out) as path:
        path.write_text(json.dumps(decision) + "\n")


OPTIONS = {
    "[flow]": ("of this round", Path),
    "[corrections]": ("poses_corrected.json", Path),
    "[before-flow]": ("of the round before", Path),
    "[before]": ("that one's decision", Path),
    "out": ("JSON, written", Path),
}


def run(arguments=None):
    """The command line; returns its exit code."""
    options = faults.arguments(arguments, __doc__, OPTIONS)
    return faults.exit_code(main, **vars(options))


if __name__ == "__main__":
    sys.exit(run())
