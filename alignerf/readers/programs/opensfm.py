"""OpenSfM's reconstruction.json, which OpenDroneMap writes, too.

Lengths in an image are in units of its longer side, from its middle. A shot's rotation
is a turn about an axis, from the world, with OpenCV's axes. Of several reconstructions
the largest is taken. Format: opensfm.org/docs/dataset.html and geometry.html.
"""

import cv2
import numpy as np

from alignerf.io import faults, json_files
from alignerf.readers import shots

NAME = "OpenSfM"
PATTERNS = ("reconstruction*.json",)
MARK = b'"cameras"'
# Projection -> COLMAP's model, and its parameters after the principal point.
LENSES = {
    "perspective": ("RADIAL", ("k1", "k2")),
    "simple_radial": ("FULL_OPENCV", ("k1", *[None] * 7)),
    "radial": ("FULL_OPENCV", ("k1", "k2", *[None] * 6)),
    "brown": ("FULL_OPENCV", ("k1", "k2", "p1", "p2", "k3", *[None] * 3)),
    "fisheye": ("RADIAL_FISHEYE", ("k1", "k2")),
    "fisheye_opencv": ("OPENCV_FISHEYE", ("k1", "k2", "k3", "k4")),
    "spherical": ("EQUIRECTANGULAR", ()),
    "equirectangular": ("EQUIRECTANGULAR", ()),
}


SIZE = dict.fromkeys(("width", "height"), json_files.positive)
POSE = dict.fromkeys(("rotation", "translation"), json_files.vector(3))


def read(path):
    try:
        parts = [part for part in json_files.read_list(path) if part["shots"]]
        largest = max(parts, key=lambda part: len(part["shots"]), default=None)
        if largest is None:
            return []
        cameras = largest["cameras"]
        return [
            given(
                f"{path}: {faults.name_of(name)}", name, cameras[shot["camera"]], shot
            )
            for name, shot in largest["shots"].items()
        ]
    except (KeyError, TypeError, AttributeError) as error:
        told = faults.shown(error)
        raise ValueError(f"{path}: a part of it is missing: {told}") from None


def given(where, name, camera, shot):
    json_files.check(camera, SIZE, where)
    json_files.check(shot, POSE, where)
    size = width, height = float(camera["width"]), float(camera["height"])
    projection, longest = camera["projection_type"], max(size)
    if projection not in LENSES:
        raise ValueError(
            f"{where}: projection {faults.shown(projection)} is none of "
            f"{', '.join(LENSES)}"
        )
    model, keys = LENSES[projection]
    focal = camera.get("focal")
    lens = [camera.get(key, focal) for key in ("focal_x", "focal_y")]
    lens += [camera.get(key, 0.0) for key in ("c_x", "c_y")]
    lens = [focal, *lens[2:]] if projection in ("perspective", "fisheye") else lens
    bent = [camera.get(key, 0.0) for key in keys]
    if model != "EQUIRECTANGULAR":
        json_files.check_value([*lens, *bent], [json_files.NUMBER], f"{where}: lens")
        lens = [longest * value for value in lens]
        lens[-2:] = lens[-2] + width / 2, lens[-1] + height / 2
    turn = cv2.Rodrigues(np.array(shot["rotation"], np.float64))[0]
    lens = shots.lens(where, model, [*lens, *bent])
    return shots.Shot(name, lens, shots.pose_from(turn, shot["translation"]), size)
