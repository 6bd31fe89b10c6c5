"""Folders as apps write them, of a capture whose truth is known."""

import json

import numpy as np
import pycolmap
from PIL import Image
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras

SIZE = (64, 48)
# (fx, fy, cx, cy) in px, as an app prints them.
LENS = (60.0, 61.0, 31.0, 25.0)


def camtoworlds(rng, count):
    """Random poses [n, 3, 4], OpenGL axes."""
    rotations = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    rotations *= np.sign(np.linalg.det(rotations))[:, None, None]
    return np.concatenate([rotations, rng.normal(size=(count, 3, 1))], axis=-1)


def write_photo(path, level=100, size=SIZE):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.full((size[1], size[0], 3), level, np.uint8)).save(path)


def write_model(
    folder,
    names,
    camtoworlds,
    *,
    suffix=".jpg",
    model="PINHOLE",
    params=LENS,
    size=SIZE,
    as_text=False,
):
    """A COLMAP model of one camera, with a point, at the folder."""
    found = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        model=model, width=size[0], height=size[1], params=[*params], camera_id=1
    )
    found.add_camera_with_trivial_rig(camera)
    for number, (name, pose) in enumerate(zip(names, camtoworlds, strict=True), 1):
        axes = pose[:, :3] @ cameras.OPENGL_FROM_OPENCV
        inverse = np.concatenate([axes.T, -axes.T @ pose[:, 3:]], axis=-1)
        image = pycolmap.Image(name=f"{name}{suffix}", camera_id=1, image_id=number)
        found.add_image_with_trivial_frame(image, pycolmap.Rigid3d(inverse))
    found.add_point3D(np.ones(3), pycolmap.Track(), np.array([1, 2, 3], np.uint8))
    folder.mkdir(parents=True, exist_ok=True)
    (found.write_text if as_text else found.write)(folder)


def write_json(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))


def change(path, **keys):
    """Change keys of a JSON; None takes one away."""
    content = json.loads(path.read_text()) | keys
    write_json(
        path, {key: value for key, value in content.items() if value is not None}
    )


def as_apple(point, pose):
    """(x, y) in px of a world point by ARKit's words, with the lens LENS.

    The camera looks along its -z, x to the right of the photo, y up; the file's pixels
    are counted from wherever the file does.
    """
    right, up, back = (float(pose[:, k] @ (point - pose[:, 3])) for k in range(3))
    fx, fy, cx, cy = LENS
    return np.array([cx + fx * right / -back, cy - fy * up / -back])


def polycam(folder, poses, *, kinds=("images", "cameras")):
    """keyframes/ of a capture; names are times in microseconds."""
    images, cameras = (folder / "keyframes" / kind for kind in kinds)
    for i, pose in enumerate(poses):
        name = str(638443502 + 1000 * i)
        write_photo(images / f"{name}.jpg", 10 * i)
        rows = {f"t_{r}{c}": float(pose[r, c]) for r in range(3) for c in range(4)}
        lens = dict(zip(("fx", "fy", "cx", "cy"), LENS, strict=True))
        sizes = {"width": SIZE[0], "height": SIZE[1], "blur_score": 115.28}
        write_json(cameras / f"{name}.json", rows | lens | sizes)
    return folder


def scanner3d(folder, poses):
    """All Data: a JSON of every third frame has a photo."""
    fx, fy, cx, cy = LENS
    for i, pose in enumerate(poses):
        name = f"frame_{3 * i:05d}"
        write_photo(folder / f"{name}.jpg", 10 * i)
        write_photo(folder / f"depth_{3 * i:05d}.png", 1)
        matrix = [*pose.ravel().tolist(), 0, 0, 0, 1]
        content = {"intrinsics": [fx, 0, cx, 0, fy, cy, 0, 0, 1]}
        content |= {"cameraPoseARFrame": matrix, "frame_index": i, "motionQuality": 1}
        write_json(folder / f"{name}.json", content)
        write_json(folder / f"frame_{3 * i + 1:05d}.json", content)
    write_json(folder / "info.json", {"device": "a phone"})
    write_photo(folder / "textured_output.jpg", size=(32, 32))
    return folder


def quaternion(rotation):
    """(x, y, z, w) of a rotation."""
    return Rotation.from_matrix(rotation).as_quat()


def record3d(folder, poses, **more):
    """EXR + JPG: rgb/<n>.jpg without leading zeros, and metadata.json."""
    fx, fy, cx, cy = LENS
    rows = []
    for i, pose in enumerate(poses):
        write_photo(folder / "rgb" / f"{i}.jpg", 10 * (i % 25))
        rows.append([*map(float, quaternion(pose[:, :3])), *pose[:, 3].tolist()])
    content = {"w": SIZE[0], "h": SIZE[1], "fps": 60, "poses": rows}
    content["K"] = [fx, 0, 0, 0, fy, 0, cx, cy, 1]
    write_json(folder / "metadata.json", content | more)
    return folder
