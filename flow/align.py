"""Warp the photos of a folder onto the renders of another.

For each render: flow to the photo of the same name and back, where both agree, the
photo warped onto the render (if it is asked for), and the misalignment in pixels.

    python -m flow.align --renders DIR --photos DIR --flow-out DIR --stats-out CSV
        [--warped-out DIR]

With `--splits train test`, folders of renders, depth and outputs have a folder for each
split, the statistics a CSV in a folder. With `--oracle DIR` beside, the flow from test
renders to its images is written as a split of its own.
"""

import sys
from pathlib import Path

from alignerf.io import faults, owned
from flow.estimation import estimate, external, folders
from flow.warping import files

# Of views without any: what they lack, and what to ask.
NO_FLOW = "a valid flow", "does the render show what the photo does?"


def main(*, splits, renders, depth, flow_out, stats_out, warped_out, oracle, **options):
    """`folders.align`; of each split in turn, where there are some.

    options: its other arguments. Raises ValueError or OSError.
    """
    if (options["flows"] is None) == (options["method"] == external.METHOD):
        method = external.METHOD
        raise ValueError(f"--flows goes with --method {method}, and it with --flows")
    if not splits:
        targets = {"flow": flow_out} | ({"warped": warped_out} if warped_out else {})
        rows = folders.align(
            renders, targets=targets, stats_out=stats_out, depth=depth, **options
        )
        files.tell_unknown(rows, *NO_FLOW)
        return
    owned.put(stats_out, [f"{split}.csv" for split in splits])
    flows, rows = options.pop("flows"), []
    for split in splits:
        targets = {"flow": flow_out / split}
        if warped_out:
            targets["warped"] = warped_out / split
        rows += folders.align(
            renders / split,
            targets=targets,
            stats_out=stats_out / f"{split}.csv",
            depth=depth and depth / split,
            flows=flows and Path(str(flows).replace("{split}", split)),
            **options,
        )
    files.tell_unknown(rows, *NO_FLOW)
    if oracle:
        # It has no flows from elsewhere, nothing before it, and counts everywhere.
        if options["method"] == external.METHOD:
            options["method"] = estimate.DEFAULT
        options |= {"photos": oracle, "masks": None}
        target, stats = {"flow": flow_out / "oracle"}, stats_out / "oracle.csv"
        owned.put(stats_out, [stats.name])
        folders.align(renders / "test", targets=target, stats_out=stats, **options)


OPTIONS = {
    "renders": ("folder of <view>.png", Path),
    "photos": ("folder of <view>.png", Path),
    "flow-out": ("folder of <view>.npz, written", Path),
    "stats-out": ("CSV, or a folder of them, written", Path),
    "[warped-out]": ("folder of warped photos", Path),
    **estimate.OPTIONS,
    "[method]": (
        "estimator",
        {"choices": (*estimate.METHODS, external.METHOD), "default": estimate.DEFAULT},
    ),
    "[flows]": ("folder of flows made elsewhere", Path),
    "[depth]": ("of the renders, for occlusions", Path),
    "[masks]": ("where photos count, if it is there", Path),
    "[threads]": ("views at once", 1),
    "[splits]": (
        "folders inside the others",
        faults.SEVERAL | {"choices": ("train", "test"), "default": ()},
    ),
    "[oracle]": ("folder of images without faults", Path),
}


def run(arguments=None):
    """The command line; returns its exit code."""
    options = faults.arguments(arguments, __doc__, OPTIONS)
    return faults.exit_code(main, **vars(options))


if __name__ == "__main__":
    sys.exit(run())
