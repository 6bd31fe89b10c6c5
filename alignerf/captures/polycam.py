"""Polycam's raw data: keyframes/{images,cameras} and, optimised, corrected_*.

`cameras/<time>.json` has fx, fy, cx, cy, width, height and the rows t_00 to t_23 of
ARKit's camera-to-world, of `images/<time>.jpg`: poses of the phone itself.
`corrected_cameras` and `corrected_images` are there where Polycam has optimised poses
and undone the lens's distortion; they are taken then. Undistorted photos have black
borders, so 15 px are cut off all round, as nerfstudio does. `depth` is not read.
Formats: PolyCam/polyform, README.md.
"""

import itertools
import logging
from pathlib import Path

from alignerf.captures import posed
from alignerf.io import faults, json_files

log = logging.getLogger(__name__)

CORRECTED = ("corrected_images", "corrected_cameras")
RAW = ("images", "cameras")
CROP_PX = 15
LENS, SIZE = ("fx", "fy", "cx", "cy"), ("width", "height")
ROWS = [[f"t_{row}{column}" for column in range(4)] for row in range(3)]
KINDS = dict.fromkeys([*LENS, *itertools.chain(*ROWS)], json_files.NUMBER)
# Exports since November 2025 leave the size away.
KINDS |= dict.fromkeys(SIZE, json_files.OrNone(json_files.NUMBER))


class Polycam(posed.App):
    name = "polycam"
    order = 5
    what = "Polycam's raw data"
    optimized = "poses optimized by Polycam"

    def detect(self, folder):
        folder = Path(folder)
        if (inner := folder / "keyframes").is_dir():
            return any((inner / name).is_dir() for name in (*CORRECTED, *RAW))
        if any((folder / name).is_dir() for name in CORRECTED):
            return True
        # Other programs have folders of these two names, too.
        photos, cameras = (folder / name for name in RAW)
        return photos.is_dir() and any(cameras.glob("[0-9]*.json"))

    def tracked_by_phone(self, folder):
        return not is_optimised(folder)

    def check(self, folder):
        inner, (photos, cameras) = keyframes_of(folder), kinds_of(folder)
        self.photos_of(folder)
        if not any((inner / cameras).glob("*.json")):
            raise ValueError(
                f"{inner}: no {cameras} beside {photos}: export Polycam's raw data "
                "again with developer mode on. COLMAP can take the photos alone: give "
                f"{inner / photos} as the folder"
            )

    def photos_of(self, folder):
        from alignerf.readers import shots

        inner, (name, _) = keyframes_of(folder), kinds_of(folder)
        if not (inner / name).is_dir():
            raise ValueError(f"{inner}: no {name}: the photos of Polycam's raw data")
        found = shots.photos_in(inner / name)
        if not found:
            raise ValueError(f"{inner / name}: no photos")
        return found

    def read_given(self, scene):
        from alignerf.readers import shots

        folder = scene.path
        self.check(folder)
        inner, (_, cameras) = keyframes_of(folder), kinds_of(folder)
        found, left_out = self.shots_of(
            folder, lambda name: inner / cameras / f"{name}.json", shot_of
        )
        if not found:
            raise ValueError(f"{inner / cameras}: no <photo>.json of any photo")
        if left_out:
            log.warning("%s: no camera of %s", inner, faults.some_names(left_out))
        shots.check_apart(found, inner / cameras)
        crop_px = CROP_PX if is_optimised(folder) else 0
        own = shots.cameras(inner, found)
        return shots.views_of(own, crop_px=crop_px, masks=scene.masks), left_out


def keyframes_of(folder):
    """The folder `keyframes` of a capture, or the folder itself where it is that."""
    inner = Path(folder) / "keyframes"
    return inner if inner.is_dir() else Path(folder)


def is_optimised(folder):
    """Whether Polycam has optimised the poses, and undistorted the photos."""
    inner = keyframes_of(folder)
    photos, cameras = (inner / name for name in CORRECTED)
    return photos.is_dir() and any(cameras.glob("*.json"))


def kinds_of(folder):
    """Names of the folders of photos and of cameras that are read."""
    return CORRECTED if is_optimised(folder) else RAW


def shot_of(name, photo, path):
    """The Shot of a camera's file."""
    import numpy as np

    from alignerf.readers import shots

    content = json_files.read(path, KINDS)
    size = [float(content[key]) for key in SIZE if content.get(key) is not None]
    pose = np.array([[content[key] for key in row] for row in ROWS], np.float64)
    lens = shots.lens(path, "PINHOLE", [content[key] for key in LENS])
    size = tuple(size) if len(size) == len(SIZE) else None
    return shots.Shot(name, lens, pose, size, photo=photo)


CAPTURE = Polycam()
