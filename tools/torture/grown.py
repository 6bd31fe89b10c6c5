"""Folders of every source, grown from a seed: what readers may meet, whole.

Each is a small folder that is taken as it is; `mutations` spoils it. Photos are noise,
no two alike, so that whatever comes out twice was in twice.
"""

import json
import struct

import cv2
import numpy as np
import pycolmap
from PIL import Image

from alignerf.scenes import cameras
from tests import app_cases, judged_cases

VIEWS, SIZE = 8, (64, 48)
# How photos may be called: with spaces, dots, patterns, other letters, as options.
STEMS = ("{:03d}", "IMG {}", "a.b.{}", "%03d_{}", "ä{}", "-{}", "r_{}", "#{}", "x=({})")
SUFFIXES = (".png", ".jpg", ".PNG", ".webp", ".bmp", ".tif")


def noise(rng, size=SIZE):
    return rng.integers(0, 256, (size[1], size[0], 3), dtype=np.uint8)


def write_photos(folder, rng, count=VIEWS, suffixes=SUFFIXES):
    """Photos of one way to be called and one suffix; returns their names."""
    folder.mkdir(parents=True, exist_ok=True)
    stem, suffix = rng.choice(STEMS), rng.choice(suffixes)
    names = [f"{stem.format(number)}{suffix}" for number in range(count)]
    for name in names:
        Image.fromarray(noise(rng)).save(folder / name)
    return names


def write_film(path, rng):
    """A film of a few frames of some size; its head may tell another number of them."""
    size = [(64, 48), (640, 40), (40, 640), (34, 34)][rng.integers(4)]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30, size)
    for _ in range(rng.integers(1, 30)):
        writer.write(noise(rng, size))
    writer.release()
    if rng.integers(2):
        content = bytearray(path.read_bytes())
        count = int(rng.choice([0, 1, 99, 10**6, 2**31 - 1, 2**32 - 1]))
        struct.pack_into("<I", content, content.index(b"avih") + 24, count)
        struct.pack_into("<I", content, content.index(b"strh") + 40, count)
        path.write_bytes(content)


def of_photos(folder, rng):
    """Photos, perhaps films and masks. Returns the scene's keys, as all of these do."""
    taken = folder / "taken"
    names = write_photos(taken, rng)
    for number in range(rng.integers(3)):
        write_film(taken / f"film %02d {number}.avi", rng)
    if not rng.integers(2):
        return {"path": str(taken), "masks": None}
    (folder / "masks").mkdir()
    for name in names[: rng.integers(1, VIEWS + 1)]:
        mask = (noise(rng) > 20).all(axis=-1).astype(np.uint8) * 255
        Image.fromarray(mask).save(folder / "masks" / f"{name}.png")
    return {"path": str(taken), "masks": str(folder / "masks")}


def frames_of(names, rng):
    frames = []
    for name, pose in zip(names, app_cases.camtoworlds(rng, len(names)), strict=True):
        matrix = [*pose.tolist(), [0.0, 0.0, 0.0, 1.0]]
        frames.append({"file_path": name, "transform_matrix": matrix})
    return frames


def of_transforms(folder, rng):
    names = [f"images/{name}" for name in write_photos(folder / "images", rng)]
    content = {"w": SIZE[0], "h": SIZE[1], "frames": frames_of(names, rng)}
    content |= {"fl_x": 60.0, "fl_y": 61.0} if rng.integers(2) else {}
    content |= {} if "fl_x" in content else {"camera_angle_x": 0.9}
    content |= {"k1": -0.05, "p2": 1e-3} if rng.integers(2) else {}
    if rng.integers(2):
        content |= {"train_filenames": names[:6], "test_filenames": names[6:]}
    write_json(folder / "transforms.json", content)
    return {"path": str(folder)}


def of_blender(folder, rng):
    for split, count in (("train", 6), ("test", 2)):
        names = write_photos(folder / split, rng, count, (".png",))
        paths = [f"./{split}/{name.removesuffix('.png')}" for name in names]
        content = {"camera_angle_x": 0.9, "frames": frames_of(paths, rng)}
        write_json(folder / f"transforms_{split}.json", content)
    return {"path": str(folder), "background": "white"}


def of_llff(folder, rng):
    write_photos(folder / "images", rng, suffixes=(".jpg", ".png"))
    rows = []
    for right, up, back, centre in app_cases.camtoworlds(rng, VIEWS).swapaxes(1, 2):
        lens = np.array([SIZE[1], SIZE[0], 60.0])
        matrix = np.stack([-up, right, back, centre, lens], axis=1)
        rows.append([*matrix.ravel(), 1.0, 10.0])
    np.save(folder / "poses_bounds.npy", np.array(rows))
    return {"path": str(folder)}


def of_mipnerf360(folder, rng):
    """A COLMAP project, its model binary or in text; of other names than texts bear."""
    names = write_photos(folder / "images", rng)
    model = pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        model="PINHOLE", width=64, height=48, params=[*app_cases.LENS], camera_id=1
    )
    model.add_camera_with_trivial_rig(camera)
    for number, pose in enumerate(app_cases.camtoworlds(rng, VIEWS), 1):
        axes = pose[:, :3] @ cameras.OPENGL_FROM_OPENCV
        inverse = np.concatenate([axes.T, -axes.T @ pose[:, 3:]], axis=-1)
        image = pycolmap.Image(name=names[number - 1], camera_id=1, image_id=number)
        model.add_image_with_trivial_frame(image, pycolmap.Rigid3d(inverse))
    (folder / "sparse/0").mkdir(parents=True)
    as_text = rng.integers(2) and " " not in names[0]
    (model.write_text if as_text else model.write)(folder / "sparse/0")
    return {"path": str(folder)}


def of_app(source):
    write = getattr(app_cases, source)

    def grow(folder, rng):
        write(folder, app_cases.camtoworlds(rng, VIEWS))
        for path in sorted(folder.rglob("*.jpg")):
            with Image.open(path) as image:
                size = image.size
            Image.fromarray(noise(rng, size)).save(path)
        return {"path": str(folder)}

    return grow


def of_judged(folder, rng):
    way = rng.choice(["taken", "kept", "opencv"])
    config = judged_cases.project(folder, str(way))
    return config.model_dump(include={"path", "external_renders"})


def write_json(path, content):
    path.write_text(json.dumps(content))


SOURCES = {
    "photos": of_photos,
    "transforms": of_transforms,
    "blender": of_blender,
    "llff": of_llff,
    "mipnerf360": of_mipnerf360,
    **{app: of_app(app) for app in ("polycam", "scanner3d", "record3d")},
    "external_renders": of_judged,
}
