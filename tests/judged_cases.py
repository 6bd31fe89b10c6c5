"""Photos, renders and cameras of another program, small, in a folder."""

import functools
import json
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from alignerf.experiment.checks import scenes as of_scenes
from alignerf.judged import geometry

SIZE = (160, 120)
CAMTOPIX = np.array([[150.0, 0, 79.0], [0, 150.0, 61.0], [0, 0, 1]])
LENS = np.array([-0.18, 0.05, 1e-3, -1e-3, 0.0])
NAMES = [f"v{i:02}" for i in range(8)]


@functools.cache
def picture(seed, size=SIZE):
    """A photo with texture of all sizes [h, w, 3] uint8, not to be written to."""
    rng = np.random.default_rng(seed)
    total = np.zeros((size[1], size[0], 3))
    for sigma in (1.2, 4, 12):
        noise = cv2.GaussianBlur(rng.normal(size=total.shape), (0, 0), sigma)
        total += noise / noise.std()
    image = np.clip(128 + 35 * total, 1, 255).astype(np.uint8)
    image.setflags(write=False)
    return image


def write_png(path, image):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).save(path)


def photos(folder, names=NAMES, size=SIZE):
    for i, name in enumerate(names):
        write_png(Path(folder) / f"{name}.png", picture(i, size))
    return Path(folder)


def transforms(path, names=NAMES, lens=None, size=SIZE, **more):
    """A transforms.json of cameras on an arc, their lens with its distortion."""
    values = LENS if lens is None else lens
    frames = []
    for i, name in enumerate(names):
        pose = np.eye(4)
        pose[:3, 3] = [0.2 * i, 0.1 * np.sin(i), 0]
        frames.append({"file_path": f"images/{name}.png"})
        frames[-1]["transform_matrix"] = pose.tolist()
    keys = ("k1", "k2", "p1", "p2", "k3")
    content = {"w": size[0], "h": size[1], "frames": frames}
    content |= {"fl_x": CAMTOPIX[0, 0], "fl_y": CAMTOPIX[1, 1]}
    content |= {"cx": CAMTOPIX[0, 2], "cy": CAMTOPIX[1, 2]}
    content |= {k: float(v) for k, v in zip(keys, values, strict=True)}
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content | more))
    return path


def shown(way, lens=None, size=SIZE):
    """The `geometry.Shown` of a way, at the size that it gives of itself."""
    values = LENS if lens is None else lens
    frames = {"taken": SIZE, "kept": SIZE}
    made = geometry.undone(CAMTOPIX, values, SIZE)
    frames |= {name: own for name, _, own in made}
    found = geometry.ways((CAMTOPIX, values), SIZE, frames[way], "render")
    return next(one for one in found if one.way == way)


def config(folder, **more):
    """A scene's keys, complete."""
    judged = {"renders": str(folder / "renders"), **more}
    return of_scenes.checked(
        {
            "source": "external_renders",
            "path": str(folder / "photos"),
            "external_renders": judged,
        }
    )


def project(folder, way="taken"):
    """A folder with photos, cameras.json-like file and renders in a way; its config."""
    photos(folder / "photos")
    transforms(folder / "transforms.json")
    one = shown(way)
    for i, name in enumerate(NAMES):
        image = picture(i)
        image = image if way == "taken" else one.picture(image)
        write_png(folder / "renders" / f"{name}.png", image)
    return config(folder, cameras=str(folder / "transforms.json"))
