"""Nerfies' and HyperNeRF's captures: dataset.json, and camera/<id>.json of each photo.

`orientation` is world-to-camera with OpenCV's axes, `position` the camera's place. The
lens is of `image_size`, that of rgb/1x. The split in dataset.json is left out. Format:
google/nerfies, README.md and nerfies/camera.py.
"""

from pathlib import Path

from alignerf.io import json_files
from alignerf.readers import shots

NAME = "Nerfies"
PATTERNS = ("dataset.json",)
MARK = b'"ids"'
CAMERA = {
    **dict.fromkeys(("focal_length", "pixel_aspect_ratio"), json_files.NUMBER),
    "skew": lambda value: json_files.NUMBER if value == 0 else (),
    "orientation": json_files.matrix(3, 3),
    **dict.fromkeys(("position", "radial_distortion"), json_files.vector(3)),
    **dict.fromkeys(
        ("principal_point", "tangential_distortion", "image_size"), json_files.vector(2)
    ),
}


def read(path):
    folder, found = Path(path).parent, []
    sizes = [p.name for p in folder.glob("rgb/*x") if p.name[:-1].isdecimal()]
    largest = min(sizes, key=lambda name: int(name[:-1]), default="1x")
    for name in json_files.read(path, {"ids": [str]})["ids"]:
        file = folder / "camera" / f"{name}.json"
        own = json_files.read(file, CAMERA)
        fx, (k1, k2, k3) = own["focal_length"], own["radial_distortion"]
        lens = [fx, fx * own["pixel_aspect_ratio"], *own["principal_point"]]
        lens += [k1, k2, *own["tangential_distortion"], k3, 0, 0, 0]
        lens = shots.lens(file, "FULL_OPENCV", lens)
        turn, size = zip(*own["orientation"], strict=True), tuple(own["image_size"])
        pose = shots.pose([*turn], own["position"])
        found.append(shots.Shot(f"rgb/{largest}/{name}.png", lens, pose, size))
    return found
