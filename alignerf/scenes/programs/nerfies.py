"""Nerfies' and HyperNeRF's captures: dataset.json, and camera/<id>.json of each photo.

`orientation` is world-to-camera with OpenCV's axes, `position` the camera's place. The
lens is of `image_size`, that of rgb/1x. The split in dataset.json is left out. Format:
google/nerfies, README.md and nerfies/camera.py.
"""

from pathlib import Path

from alignerf.io import faults, json_files
from alignerf.scenes import prepare
from alignerf.scenes.formats import shots
from alignerf.scenes.programs import base

NAME = "Nerfies"
PATTERNS = ("dataset.json",)
MARK = b'"ids"'
NUMBERS = ("focal_length", "pixel_aspect_ratio", "skew")
LISTS = {
    "principal_point": 2,
    "radial_distortion": 3,
    "tangential_distortion": 2,
    "position": 3,
    "image_size": 2,
}
KINDS = dict.fromkeys(NUMBERS, json_files.NUMBER)
KINDS |= dict.fromkeys((*LISTS, "orientation"), list)


def read(path):
    folder, found = Path(path).parent, []
    sizes = [p.name for p in folder.glob("rgb/*x") if p.name[:-1].isdecimal()]
    largest = min(sizes, key=lambda name: int(name[:-1]), default="1x")
    for name in json_files.read(path, {"ids": list})["ids"]:
        if not isinstance(name, str):
            raise ValueError(f"{path}: ids: {faults.shown(name)} is no text")
        file = folder / "camera" / f"{name}.json"
        content = json_files.read(file, KINDS)
        turn = prepare.matrix_of(content["orientation"], (3, 3))
        if turn is None or content["skew"]:
            fault = (
                "orientation is not 3x3 numbers" if turn is None else "skew is not 0"
            )
            raise ValueError(f"{file}: {fault}")
        centre, (k1, k2, k3), (p1, p2), place, size = (
            shots.numbers(file, content[key], key, count).tolist()
            for key, count in LISTS.items()
        )
        fx = content["focal_length"]
        lens = [fx, fx * content["pixel_aspect_ratio"], *centre, k1, k2, p1, p2, k3]
        lens = base.lens(file, "FULL_OPENCV", [*lens, 0.0, 0.0, 0.0])
        pose = base.pose(turn.T, place)
        found.append(base.given(f"rgb/{largest}/{name}.png", lens, tuple(size), pose))
    return found
