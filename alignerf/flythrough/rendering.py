"""Frames of a film: views of trained models along a path, as PNGs that are kept.

A run that is killed goes on from the frames that are there. They belong to one path,
one size and the same models, which `identity.json` beside them says.
"""

import contextlib
import hashlib
import json
import logging
import shutil
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.cameras import moves
from alignerf.experiment.tables import sides
from alignerf.files import atomic, images, json_files, machine, progress
from alignerf.flythrough import nerfstudio
from alignerf.processes import devices
from alignerf.scenes import cameras, prepared
from alignerf.training import renderer

log = logging.getLogger("alignerf")

# What rendering may take of two minutes: a program is compiled for each side, and the
# film is written. No side is smaller than LEAST_SIDE_PX.
BUDGET_S, LEAST_SIDE_PX = 80.0, 48
TIMING = {"view_time_s": json_files.NUMBER}


class Views(NamedTuple):
    """The views of a side: a function to render one, and its cameras."""

    render: object
    pixtocam: np.ndarray
    poses: np.ndarray

    def image(self, frame):
        """The image [h, w, 3] of a frame."""
        return self.render(self.pixtocam, self.poses[frame])[0]


def size_of(loaded: prepared.Scene, path, every, count):
    """(width, height) at which `count` frames of every side take BUDGET_S.

    By what test views have taken of each side, at the size of training. Never larger
    than that.
    """
    view_s = sum(view_time_s(side) for side in every)
    aspect = path.width / path.height
    pixels = loaded.width * loaded.height
    pixels *= min(1.0, BUDGET_S / max(count * view_s, 1e-9))
    height = (pixels / aspect) ** 0.5
    # Of a whole number, rounding may leave a little less.
    return tuple(
        max(LEAST_SIDE_PX, int(side + 1e-6)) for side in (aspect * height, height)
    )


def view_time_s(side: sides.Side):
    """Seconds that a view of a side's training takes with all cores of this process."""
    time_s = json_files.read(side.timing, TIMING)["view_time_s"]
    if time_s < 0:
        raise ValueError(f"{side.timing}: view_time_s is {time_s}")
    return time_s * side.threads / machine.cores()


def frames(path: nerfstudio.CameraPath):
    """(poses [m, 3, 4] that differ, index [n] of the pose of each frame)."""
    flat = path.poses.reshape(len(path.poses), -1)
    _, first, inverse = np.unique(flat, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return path.poses[first[order]], np.argsort(order)[inverse.ravel()]


def render_all(loaded, path, poses, every, size, folder):
    """Render what is not in the folder yet: {side}/{frame}.png, from 0 on."""
    folder = Path(folder)
    keep_or_clear(folder, identity(path, poses, every, size))
    todo = [
        (side, frame)
        for frame in range(len(poses))
        for side in range(len(every))
        if not is_there(file_of(folder, side, frame), size)
    ]
    total = len(every) * len(poses)
    if len(todo) < total:
        log.info("%d of %d frames are there: going on", total - len(todo), total)
    views = {
        side: views_of(loaded, path, poses, every[side], size)
        for side in sorted({side for side, _ in todo})
    }

    def render(one):
        side, frame = one
        images.write(file_of(folder, side, frame), views[side].image(frame))

    # The first of each side alone, and before time is taken: they compile.
    first = [next(one for one in todo if one[0] == side) for side in views]
    for one in first:
        render(one)
    rest = [one for one in todo if one not in first]
    done = total - len(rest)
    bar = progress.Progress("fly-through", total, done=done, unit="frame")
    with contextlib.closing(bar):
        for _ in devices.map_in_threads(render, rest):
            bar.advance()


def views_of(loaded, path, poses, side: sides.Side, size) -> Views:
    """The views of a side along poses [n, 3, 4], which are in the scene's own frame.

    Cameras that a training has moved may all have moved alike, and may have another
    focal length: the path is taken along.
    """
    method, params = renderer.read_model(side.job, side.model, loaded)
    seen = prepared.load(loaded.folder, side.cameras)
    train = loaded.views("train")
    own, learnt = (one.camtoworlds[train] for one in (loaded, seen))
    similarity = moves.in_common(own, learnt)
    lenses = [1 / one.pixtocams[train, 1, 1] for one in (loaded, seen)]
    longer = float(np.median(lenses[1] / lenses[0]))
    width, height = size
    focal_px = longer * nerfstudio.focal_px(float(np.median(path.fov_deg)), height)
    frame = cameras.frame_of(
        prepared.read_cameras(loaded.folder / "cameras.npz")["camtoworlds"]
    )
    return Views(
        renderer.make_renderer(method, params, width, height),
        cameras.intrinsics(focal_px, width, height),
        cameras.apply_similarity(frame.normalised(poses), *similarity),
    )


def identity(path, poses, every, size):
    """What frames are of, as a digest."""
    digest = hashlib.sha256(json.dumps([size, [s.job for s in every]]).encode())
    digest.update(np.ascontiguousarray(poses))
    digest.update(np.ascontiguousarray(path.fov_deg))
    for side in every:
        for file in (side.model, side.cameras):
            digest.update(Path(file).read_bytes())
    return digest.hexdigest()


def keep_or_clear(folder, wanted):
    """Remove frames of anything else, and note what the next ones are of."""
    note = folder / "identity.json"
    try:
        known = json_files.read(note, {"frames": str})["frames"]
    except (OSError, ValueError):
        known = None
    if known != wanted:
        shutil.rmtree(folder, ignore_errors=True)
        with atomic.replace_file(note) as temporary:
            temporary.write_text(json.dumps({"frames": wanted}), encoding="utf-8")


def file_of(folder, side, frame):
    """The file of a frame."""
    return Path(folder) / str(side) / f"{frame:04d}.png"


def is_there(file, size):
    """Whether a whole frame of this size is there."""
    try:
        images.read(file, size=size)
    except (OSError, ValueError):
        return False
    return True
