"""Put the cameras of the training views right: `python -m alignerf.correct_poses`.

A round's renders, seen by its cameras, and the flow from them to the photos say how
each camera must move so that its render falls onto its photo (see
`flow.camera.correct`). Writes the cameras for the next round, and what was done to
each.

What all corrections of a round have in common (a turn, a shift and a scale of the
world) cannot be seen in any photo. It is taken out, so that the frame of the training
views does not drift from that of the test views, which stay as they are. Views that are
left alone count as corrections of zero, and so hold the frame.
"""

import json
import logging
import time
from functools import partial

import numpy as np

from alignerf.alignment import cameras
from alignerf.exports import held_out
from alignerf.io import atomic, faults
from alignerf.scenes import prepared
from alignerf.sfm import pose_error
from flow.camera import correct

log = logging.getLogger("alignerf")


OPTIONS = {
    "scene": "prepared scene folder",
    "cameras": "of the renders",
    "flow": "folder of <view>.npz, to photos",
    "depth": "folder of the renders' depth",
    "[truth]": "the scene's truth folder, to be compared with",
    "out": "cameras.npz, written",
    "report": "what was done, written",
    "[threads]": ("views at once", 1),
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    started = time.monotonic()
    original = prepared.load(args.scene)
    before = prepared.load(args.scene, args.cameras)
    train = before.views("train")
    corrections = correct.corrections(
        [partial(held_out.read, before, view, args.flow, args.depth) for view in train],
        threads=args.threads,
    )
    after = cameras.corrected(before, train, corrections)
    report = {
        "views": len(train),
        "left_alone": sum(bool(correction.left_alone) for correction in corrections),
        "only_turned": sum(map(is_only_turned, corrections)),
        "correction_px": cameras.median_px(corrections),
        "focal_ratio": float(np.exp(cameras.zoom_of(corrections))),
        "frame": frame_of(*cameras.common(before, train, corrections)),
    }
    if args.truth:
        true = prepared.read_cameras(f"{args.truth}/cameras.npz")
        states = {"given": original, "before": before, "after": after}
        points = pose_error.true_points(original, args.truth, train)
        report["pose_error_px"] = {
            name: pose_error.median_px(state, true, points)
            for name, state in states.items()
        }
    report["time_s"] = round(time.monotonic() - started, 3)
    report["of_views"] = [
        row(original, after, view, correction)
        for view, correction in zip(train, corrections, strict=True)
    ]
    # Entered first, so in place last: the report says that the cameras are whole.
    with (
        atomic.replace_file(args.report) as report_path,
        atomic.replace_file(args.out) as path,
    ):
        moved = cameras.moved_views(train, corrections)
        prepared.write_cameras(path, after, args.cameras, moved)
        report_path.write_text(json.dumps(report, indent=1) + "\n")
    say(report)


def frame_of(scale, rotation, translation):
    """What was taken out of all corrections, in units of the normalised scene."""
    turn, shift = rotation.tolist(), translation.tolist()
    return {"scale": float(scale), "rotation": turn, "translation": shift}


def is_only_turned(correction):
    """Whether a camera has moved without a step: it sees nothing that is near."""
    return not (correction.left_alone or correction.motion.centre.any())


def say(report):
    """Log which cameras stayed, and why; by how far the others moved."""
    staying = {}
    for line in report["of_views"]:
        if line["left_alone"]:
            staying.setdefault(line["left_alone"], []).append(line["view"])
    for reason, views in staying.items():
        if len(views) == report["views"]:
            log.warning("all cameras stay: %s", reason)
            return
        verb = "view %s stays: %s" if len(views) == 1 else "views %s stay: %s"
        log.warning(verb, ", ".join(views), reason)
    if count := report["only_turned"]:
        log.info(
            "%d of %d cameras got a turn and a zoom only: without depth all they see "
            "counts as far away",
            *(count, report["views"]),
        )
    log.info("cameras moved by %.3f px in the median", report["correction_px"])


def row(original: prepared.Scene, after: prepared.Scene, view, correction):
    """A view's row of the report: its whole correction, from the scene's own camera."""
    before, now = (camera_of(state, view) for state in (original, after))
    size = original.width, original.height
    return {
        "view": original.names[view],
        **pose_error.difference(before, now, size, correction.depth),
        "this_round_px": correction.length_px,
        "noise_px": correction.noise_px,
        "valid_fraction": correction.valid_fraction,
        "depth": correction.depth,
        "left_alone": correction.left_alone,
    }


def camera_of(scene: prepared.Scene, view):
    return scene.pixtocams[view], scene.camtoworlds[view]


if __name__ == "__main__":
    faults.run(main)
