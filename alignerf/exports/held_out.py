"""Cameras of held-out views, each fitted to its own photo.

Training moves the cameras that it learns from. Those of held-out views stay as they
were given, and are then the only wrong ones. The flow from their renders to their
photos says how each has to move; all of its pixels are used.
"""

import dataclasses
import logging
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.io import archives, faults, json_files
from alignerf.scenes import cameras, prepared
from flow.camera import correct
from flow.camera import motion as camera_motion
from flow.warping import files

log = logging.getLogger("alignerf")

# Of a report of corrections.
VECTOR = json_files.list_of(3, json_files.NUMBER)
OF_FRAME = {"scale": json_files.positive, "translation": VECTOR}
OF_FRAME |= {"rotation": json_files.list_of(3, VECTOR)}
REPORT = {"focal_ratio": json_files.positive, "frame": OF_FRAME}


class Frame(NamedTuple):
    """How cameras were corrected by the flow of these very renders.

    log_focal: the zoom that they got. similarity: (scale, rotation, translation) of the
    normalised world, which was taken out of all corrections.
    """

    log_focal: float = 0.0
    similarity: tuple = (1.0, np.eye(3), np.zeros(3))


def frame_of(report) -> Frame:
    """The frame by the report of `alignerf.correct_poses`; ValueError naming it."""
    content = json_files.read(report, REPORT)
    scale, turn, shift = (
        np.array(content["frame"][key], np.float64)
        for key in ("scale", "rotation", "translation")
    )
    return Frame(float(np.log(content["focal_ratio"])), (float(scale), turn, shift))


def fit(loaded: prepared.Scene, cameras_path, flow, depth, out, frame=None):
    """Write cameras.npz with test views' cameras fitted; returns the names of these.

    loaded: the scene with the cameras of cameras_path, which the renders were seen by;
    or, with a `Frame`, which this has made of those. flow, depth: folders of <view>.npz
    of the test views. A camera whose flow says too little, or disagrees with all
    others', stays as it is.
    """
    test, frame = loaded.views("test"), frame or Frame()
    back = np.exp(frame.log_focal)
    pixtocams = np.diag([back, back, 1.0]) @ loaded.pixtocams
    rendered = dataclasses.replace(loaded, pixtocams=pixtocams)
    corrections = correct.corrections(
        [partial(read, rendered, view, flow, depth) for view in test],
        min_px=0.0,
        zooms=False,
        log_focal=frame.log_focal,
    )
    moved, camtoworlds = [], loaded.camtoworlds.copy()
    for view, correction in zip(test, corrections, strict=True):
        name = loaded.names[view]
        if correction.left_alone:
            log.warning("view %s stays: %s", name, correction.left_alone)
            continue
        camera = pixtocams[view], loaded.camtoworlds[view]
        camtoworlds[view] = camera_motion.apply(correction.motion, *camera)[1]
        moved.append(view)
    camtoworlds[moved] = cameras.apply_similarity(camtoworlds[moved], *frame.similarity)
    fitted = dataclasses.replace(loaded, camtoworlds=camtoworlds)
    prepared.write_cameras(out, fitted, cameras_path, moved)
    names = [loaded.names[view] for view in moved]
    log.info("cameras fitted to held-out photos: %s", faults.some_names(names))
    return names


def read(rendered: prepared.Scene, view, flow, depth) -> correct.View:
    """A view's flow to its photo and its depth, from folders of <view>.npz.

    rendered: the scene with the cameras of the renders. view: its index. Raises
    ValueError with the file's name where its size is not the views'.
    """
    name = f"{rendered.names[view]}.npz"
    flow_px, valid = files.read_flow(Path(flow) / name)
    depth_map = archives.read(Path(depth) / name, ["depth"])["depth"]
    size = rendered.height, rendered.width
    for folder, image in ((flow, valid), (depth, depth_map)):
        if image.shape != size:
            raise ValueError(f"{Path(folder) / name}: {image.shape}, not {size} px")
    return correct.View(flow_px, valid, rendered.pixtocams[view], depth_map)
