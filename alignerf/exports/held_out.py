"""Cameras of held-out views, each fitted to its own photo.

Training moves the cameras that it learns from. Those of held-out views stay as they
were given, and are then the only wrong ones. The flow from their renders to their
photos says how each has to move; all of its pixels are used.
"""

import dataclasses
import logging
from pathlib import Path

from alignerf.files import archives, faults
from alignerf.scenes import prepared
from flow.camera import correct
from flow.camera import motion as camera_motion
from flow.warping import files

log = logging.getLogger("alignerf")


def fit(loaded: prepared.Scene, cameras_path, flow, depth, out):
    """Write cameras.npz with test views' cameras fitted; returns the names of these.

    loaded: the scene with the cameras of cameras_path, which the renders were seen by.
    flow, depth: folders of <view>.npz of the test views. A camera whose flow says too
    little, or disagrees with all others', stays as it is.
    """
    test = loaded.views("test")
    corrections = correct.corrections(
        lambda: (view_of(loaded, view, flow, depth) for view in test),
        least_px=0.0,
        zooms=False,
    )
    moved, camtoworlds = [], loaded.camtoworlds.copy()
    for view, correction in zip(test, corrections, strict=True):
        name = loaded.names[view]
        if correction.left_alone:
            log.warning("view %s stays: %s", name, correction.left_alone)
            continue
        camera = loaded.pixtocams[view], loaded.camtoworlds[view]
        camtoworlds[view] = camera_motion.apply(correction.motion, *camera)[1]
        moved.append(view)
    fitted = dataclasses.replace(loaded, camtoworlds=camtoworlds)
    prepared.write_cameras(out, fitted, cameras_path, moved)
    names = [loaded.names[view] for view in moved]
    log.info("cameras fitted to held-out photos: %s", faults.some_names(names))
    return names


def view_of(loaded: prepared.Scene, view, flow, depth) -> correct.View:
    """A view's flow and depth, of the views' size."""
    name = f"{loaded.names[view]}.npz"
    flow_px, valid = files.read_flow(Path(flow) / name)
    distance = archives.read(Path(depth) / name, ["depth"])["depth"]
    size = loaded.height, loaded.width
    for folder, image in ((flow, valid), (depth, distance)):
        if image.shape != size:
            raise ValueError(f"{Path(folder) / name}: {image.shape}, not {size} px")
    return correct.View(flow_px, valid, loaded.pixtocams[view], distance)
