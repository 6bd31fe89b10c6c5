"""3d Scanner App, "All Data": frame_<n>.json and frame_<n>.jpg in one folder.

A frame's JSON has `intrinsics` (9 numbers) and `cameraPoseARFrame` (16), both row by
row: ARKit's own, of the photo as the sensor saw it, pixel centres at whole numbers.
There are more JSONs than photos, as depth comes more often: those alone are left. What
else lies there (depth_*, conf_*, thumb_*, export.obj, info.json) is not read. Photos
are as the lens made them, and the app says nothing of its distortion.
"""

import logging
from pathlib import Path

import numpy as np

from alignerf.files import faults, json_files
from alignerf.scenes import photos
from alignerf.scenes.apps import phone

log = logging.getLogger(__name__)

PATTERN = "frame_*"
LENS, POSE = "intrinsics", "cameraPoseARFrame"
# ARKit counts pixels from the middle of the first one, we from its corner.
CENTRE_PX = 0.5
# Of a photo's sides: no phone's optical axis is further from its middle.
OFF_CENTRE = 0.2


def is_like(folder):
    """Whether a folder is meant to be 3d Scanner App's, complete or not."""
    return any(Path(folder).glob("frame_[0-9]*.json"))


def photos_of(folder):
    """{view name: path} of the photos; ValueError where there are none."""
    found = phone.photos_in(folder, PATTERN)
    if not found:
        raise ValueError(
            f"{folder}: frame_*.json, but no frame_*.jpg: export the scan again as "
            '"All Data"'
        )
    return found


def check(folder):
    """ValueError naming what a folder that is meant to be the app's lacks."""
    taken = photos_of(folder)
    if not any((Path(folder) / f"{name}.json").is_file() for name in taken):
        raise ValueError(f"{folder}: no photo has a frame_*.json of its number")


def read(folder):
    """(prepare.PosedViews, names of the photos without a JSON).

    Raises ValueError with one line that names the file and the key.
    """
    check(folder)
    shots, left_out = [], []
    for name, photo in photos_of(folder).items():
        path = Path(folder) / f"{name}.json"
        if path.is_file():
            shots.append(shot_of(name, photo, path))
        else:
            left_out.append(name)
    if left_out:
        log.warning("%s: no JSON of %s", folder, faults.some_names(left_out))
    phone.check_apart(shots, folder)
    return phone.views_of(shots, folder), left_out


def shot_of(name, photo, path):
    """The Shot of a frame's file."""
    content = json_files.read(path, {LENS: list, POSE: list})
    lens = phone.numbers(path, content, LENS, 9).reshape(3, 3)
    matrix = phone.numbers(path, content, POSE, 16).reshape(4, 4)
    if not np.allclose(lens[[0, 1, 2, 2, 2], [1, 0, 0, 1, 2]], [0, 0, 0, 0, 1]):
        raise ValueError(f"{path}: {LENS} are not fx 0 cx, 0 fy cy, 0 0 1")
    if not np.allclose(matrix[3], [0, 0, 0, 1]):
        raise ValueError(f"{path}: {POSE}: its last row is not 0 0 0 1")
    values = lens[[0, 1, 0, 1], [0, 1, 2, 2]]
    check_middle(path, values[2:], photo)
    return phone.Shot(
        name=name,
        photo=photo,
        camtopix=phone.pinhole(path, values, where=LENS, centre_px=CENTRE_PX),
        size=None,
        camtoworld=phone.pose(matrix, where=f"{path}: {POSE}"),
    )


def check_middle(path, centre, photo):
    """ValueError where intrinsics are of another size, which the file does not say."""
    size = np.array(photos.head(photo).size)
    if (np.abs(centre / size - 0.5) > OFF_CENTRE).any():
        raise ValueError(
            f"{path}: {LENS} are not of {photo.name}, which is {size[0]}x{size[1]}: "
            f"the optical axis is at {centre[0]:g}, {centre[1]:g}"
        )
