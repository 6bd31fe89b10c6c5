"""The cameras.json that 3D Gaussian splatting writes beside its model.

Pinholes, whose principal point is the middle; a rotation is camera-to-world with
OpenCV's axes (`camera_to_JSON` of graphdeco-inria/gaussian-splatting).
"""

from alignerf.io import json_files
from alignerf.scenes import prepare
from alignerf.scenes.programs import base

NAME = "3D Gaussian splatting"
PATTERNS = ("cameras.json",)
MARK = b'"img_name"'
KINDS = {
    "img_name": str,
    **dict.fromkeys(("width", "height", "fx", "fy"), json_files.NUMBER),
    **dict.fromkeys(("position", "rotation"), list),
}


def read(path):
    found = []
    for i, entry in enumerate(json_files.read_list(path)):
        where = f"{path}: camera {i}"
        try:
            json_files.check(entry, KINDS)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from None
        size = width, height = float(entry["width"]), float(entry["height"])
        if not (1 <= width <= 1e6 and 1 <= height <= 1e6):
            raise ValueError(f"{where}: its size is none")
        turn = prepare.matrix_of(entry["rotation"], (3, 3))
        place = prepare.matrix_of([entry["position"]], (1, 3))
        if turn is None or place is None:
            raise ValueError(f"{where}: its rotation or position is none")
        params = [entry["fx"], entry["fy"], width / 2, height / 2]
        lens = base.lens(where, "PINHOLE", params)
        pose = base.pose(turn, place)
        found.append(base.given(entry["img_name"], lens, size, pose))
    return found
