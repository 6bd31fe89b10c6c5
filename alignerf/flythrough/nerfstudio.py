"""A camera path as nerfstudio's `ns-render camera-path` takes it: camera_path.json.

Each camera is a pinhole whose principal point is the image's middle. `fov` is the
vertical field of view in degrees, `camera_to_world` a 4x4 pose with OpenGL axes, row by
row. nerfstudio trains in a frame of its own: its dataparser_transforms.json says how
that lies to the frame of transforms.json.
"""

from typing import NamedTuple

import numpy as np

from alignerf.files import json_files
from alignerf.scenes import cameras, prepare

# Of a file that anybody may have written.
MOST_CAMERAS = 10**5
SAID = {
    "render_height": int,
    "render_width": int,
    "fps": json_files.NUMBER,
    "camera_path": list,
}
BOTTOM = np.array([[0.0, 0.0, 0.0, 1.0]])
TRANSFORMS = {"transform": list, "scale": json_files.NUMBER}


class CameraPath(NamedTuple):
    """Poses [n, 3, 4], their vertical fields of view [n] in degrees, size, speed."""

    poses: np.ndarray
    fov_deg: np.ndarray
    width: int
    height: int
    fps: float


def content(path: CameraPath):
    """The JSON of a camera path, as nerfstudio's viewer writes it."""
    each = [
        {
            "camera_to_world": _whole(pose).ravel().tolist(),
            "fov": float(fov_deg),
            "aspect": path.width / path.height,
        }
        for pose, fov_deg in zip(path.poses, path.fov_deg, strict=True)
    ]
    return {
        "camera_type": "perspective",
        "render_height": path.height,
        "render_width": path.width,
        "fps": path.fps,
        "seconds": len(each) / path.fps,
        "is_cycle": True,
        "smoothness_value": 0.0,
        "crop": None,
        "keyframes": [],
        "camera_path": each,
    }


def read(file) -> CameraPath:
    """A camera path from its file; ValueError names the file, and the camera."""
    found = json_files.read(file, SAID)
    size, each = (found["render_width"], found["render_height"]), found["camera_path"]
    if not (all(1 <= side <= 2**15 for side in size) and 0 < found["fps"] <= 1000):
        raise ValueError(f"{file}: no film has such a size, or so many frames a second")
    if not 1 <= len(each) <= MOST_CAMERAS:
        raise ValueError(f"{file}: {len(each)} cameras")
    poses, fov_deg = [], []
    for number, one in enumerate(each):
        try:
            json_files.check(one, {"camera_to_world": list, "fov": json_files.NUMBER})
            matrix = np.array(one["camera_to_world"], np.float64).reshape(4, 4)
        except (ValueError, TypeError, OverflowError) as error:
            raise ValueError(f"{file}: camera {number}: {error}") from None
        if not (np.abs(matrix) < cameras.LARGEST).all() or not 0 < one["fov"] < 180:
            raise ValueError(f"{file}: camera {number} is none")
        where = f"{file}: camera {number}"
        turn = prepare.nearest_rotation(matrix[:3, :3], where=where)
        poses.append(np.concatenate([turn, matrix[:3, 3:]], axis=-1))
        fov_deg.append(float(one["fov"]))
    return CameraPath(np.stack(poses), np.array(fov_deg), *size, float(found["fps"]))


def read_transforms(file, data=None):
    """(transform [3, 4], scale) from the frame of cameras to nerfstudio's.

    file: its dataparser_transforms.json. data: the transforms.json that it has trained
    on, whose frame is that of the cameras. `ns-process-data` notes in it how that frame
    lies to COLMAP's (`applied_transform`), and the first file begins with COLMAP's.
    """
    found = json_files.read(file, TRANSFORMS)
    transform, scale = _matrix(file, "transform", found), _scale(file, "scale", found)
    if data is None:
        return transform, scale
    applied = json_files.read(data)
    if "applied_transform" in applied:
        before = _whole(_matrix(data, "applied_transform", applied))
        transform = (_whole(transform) @ np.linalg.inv(before))[:3]
    if "applied_scale" in applied:
        scale /= _scale(data, "applied_scale", applied)
    return transform, scale


def _matrix(file, key, content):
    """A rotation and a shift [3, 4] under a key of a file."""
    try:
        matrix = np.array(content[key], np.float64)
    except (ValueError, TypeError, OverflowError):
        matrix = np.zeros(())
    if matrix.shape != (3, 4) or not (np.abs(matrix) < cameras.LARGEST).all():
        raise ValueError(f"{file}: {key!r} is not 3x4 numbers")
    prepare.nearest_rotation(matrix[:, :3], where=f"{file}: {key!r}")
    return matrix


def _scale(file, key, content):
    """A scale under a key of a file."""
    value = content[key]
    known = isinstance(value, int | float) and not isinstance(value, bool)
    if not (known and 0 < value < cameras.LARGEST):
        raise ValueError(f"{file}: {key!r} is {value!r:.60}")
    return float(value)


def _whole(matrix):
    """A matrix [3, 4] as [4, 4]."""
    return np.concatenate([matrix, BOTTOM])


def in_frame(path: CameraPath, transform, scale):
    """The path in nerfstudio's frame: turned and moved by transform, then scaled."""
    turns = transform[:, :3] @ path.poses[:, :, :3]
    places = path.poses[:, :, 3] @ transform[:, :3].T + transform[:, 3]
    poses = np.concatenate([turns, scale * places[..., None]], axis=-1)
    return path._replace(poses=poses)


def focal_px(fov_deg, height):
    """Focal length in px of a vertical field of view."""
    return 0.5 * height / np.tan(0.5 * np.radians(fov_deg))


def fov_deg(focal_px, height):
    """The vertical field of view of a focal length in px."""
    return float(np.degrees(2 * np.arctan(0.5 * height / focal_px)))
