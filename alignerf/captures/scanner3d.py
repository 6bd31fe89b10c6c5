"""3d Scanner App, "All Data": frame_<n>.json and frame_<n>.jpg in one folder.

A frame's JSON has `intrinsics` (9 numbers) and `cameraPoseARFrame` (16), both row by
row: ARKit's own, of the photo as the sensor saw it, pixel centres at whole numbers.
There are more JSONs than photos, as depth comes more often: those alone are left. What
else lies there (depth_*, conf_*, thumb_*, export.obj, info.json) is not read. Photos
are as the lens made them, and the app says nothing of its distortion.
"""

import logging
from pathlib import Path

from alignerf.captures import posed
from alignerf.io import faults, json_files

log = logging.getLogger(__name__)

PATTERN = "frame_*"
LENS, POSE = "intrinsics", "cameraPoseARFrame"
KINDS = {LENS: json_files.vector(9), POSE: json_files.vector(16)}
# ARKit counts pixels from the middle of the first one, we from its corner.
CENTRE_PX = 0.5
# Of a photo's sides: no phone's optical axis is further from its middle.
OFF_CENTRE = 0.2


class Scanner3d(posed.App):
    name = "scanner3d"
    order = 6
    what = "3d Scanner App's All Data"

    def detect(self, folder):
        return any(Path(folder).glob("frame_[0-9]*.json"))

    def photos_of(self, folder):
        from alignerf.readers import shots

        found = shots.photos_in(folder, PATTERN)
        if not found:
            raise ValueError(
                f"{folder}: frame_*.json, but no frame_*.jpg: export the scan again as "
                '"All Data"'
            )
        return found

    def check(self, folder):
        taken = self.photos_of(folder)
        if not any((Path(folder) / f"{name}.json").is_file() for name in taken):
            raise ValueError(f"{folder}: no photo has a frame_*.json of its number")

    def read_given(self, scene):
        from alignerf.readers import shots

        folder = scene.path
        self.check(folder)
        found, left_out = self.shots_of(
            folder, lambda name: Path(folder) / f"{name}.json", shot_of
        )
        if left_out:
            log.warning("%s: no JSON of %s", folder, faults.some_names(left_out))
        shots.check_apart(found, folder)
        own = shots.cameras(folder, found)
        return shots.views_of(own, masks=scene.masks), left_out


def shot_of(name, photo, path):
    """The Shot of a frame's file."""
    import numpy as np

    from alignerf.readers import shots

    content = json_files.read(path, KINDS)
    lens = np.reshape(content[LENS], (3, 3)).astype(np.float64)
    if not np.allclose(lens[[0, 1, 2, 2, 2], [1, 0, 0, 1, 2]], [0, 0, 0, 0, 1]):
        raise ValueError(f"{path}: {LENS} are not fx 0 cx, 0 fy cy, 0 0 1")
    rows = {POSE: np.reshape(content[POSE], (4, 4)).tolist()}
    pose = shots.rows(path, POSE, rows, json_files.matrix(4, 4))
    check_middle(path, lens[:2, 2], photo)
    params = [*lens[[0, 1], [0, 1]], *(lens[:2, 2] + CENTRE_PX)]
    lens = shots.lens(path, "PINHOLE", params)
    return shots.Shot(name, lens, pose, photo=photo)


def check_middle(path, centre, photo):
    """ValueError where intrinsics are of another size, which the file does not say."""
    import numpy as np

    from alignerf.scenes import photos

    size = np.array(photos.head(photo).size)
    if (np.abs(centre / size - 0.5) > OFF_CENTRE).any():
        raise ValueError(
            f"{path}: {LENS} are not of {photo.name}, which is {size[0]}x{size[1]}: "
            f"the optical axis is at {centre[0]:g}, {centre[1]:g}"
        )


CAPTURE = Scanner3d()
