"""The cameras.json that 3D Gaussian splatting writes beside its model.

Pinholes, whose principal point is the middle; a rotation is camera-to-world with
OpenCV's axes (`camera_to_JSON` of graphdeco-inria/gaussian-splatting).
"""

from alignerf.io import faults, json_files
from alignerf.readers import shots

NAME = "3D Gaussian splatting"
PATTERNS = ("cameras.json",)
MARK = b'"img_name"'
ENTRY = {
    "img_name": str,
    **dict.fromkeys(("width", "height", "fx", "fy"), json_files.positive),
    "position": json_files.vector(3),
    "rotation": json_files.matrix(3, 3),
}


def read(path):
    found = []
    for one in json_files.read_list(path, ENTRY):
        where = f"{path}: {faults.name_of(one['img_name'])}"
        size = width, height = float(one["width"]), float(one["height"])
        lens = [one["fx"], one["fy"], width / 2, height / 2]
        lens = shots.lens(where, "PINHOLE", lens)
        pose = shots.pose(one["rotation"], one["position"])
        found.append(shots.Shot(one["img_name"], lens, pose, size))
    return found
