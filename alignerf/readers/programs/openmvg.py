"""openMVG's sfm_data.json, of its own program or converted from its binary.

A view's photo, lens and pose are found by numbers. A rotation is from the world, with
OpenCV's axes, a centre is the camera's place. Format: openMVG's
src/openMVG/sfm/sfm_data_io_cereal.cpp and cameras/*_io.hpp.
"""

import numpy as np

from alignerf.io import faults, json_files
from alignerf.readers import shots

NAME = "openMVG"
PATTERNS = ("sfm_data*.json",)
MARK = b'"sfm_data_version"'
# Key of the distortion, the number of its values, COLMAP's model of f, c and these.
LENSES = {
    "disto_k1": (1, "SIMPLE_RADIAL"),
    "disto_k3": (3, "FULL_OPENCV"),
    "disto_t2": (5, "FULL_OPENCV"),
    "fisheye": (4, "OPENCV_FISHEYE"),
}


LENS = dict.fromkeys(("width", "height"), json_files.positive)
LENS |= {"focal_length": json_files.NUMBER, "principal_point": json_files.vector(2)}
POSE = {"rotation": json_files.matrix(3, 3), "center": json_files.vector(3)}


def read(path):
    content = json_files.read(
        path, dict.fromkeys(("views", "intrinsics", "extrinsics"), list)
    )
    try:
        lenses = {one["key"]: data_of(one) for one in content["intrinsics"]}
        poses = {one["key"]: one["value"] for one in content["extrinsics"]}
        views = [data_of(one) for one in content["views"]]
        return [
            given(path, view, lenses[view["id_intrinsic"]], poses[view["id_pose"]])
            for view in views
            if view["id_pose"] in poses and view["id_intrinsic"] in lenses
        ]
    except (KeyError, TypeError, AttributeError) as error:
        told = faults.shown(error)
        raise ValueError(f"{path}: a part of it is missing: {told}") from None


def data_of(entry):
    """The values of an entry, those of the class that its own builds on, too."""
    data = entry["value"]["ptr_wrapper"]["data"]
    return data | data.get("value0", {})


def given(path, view, lens, pose):
    parts = (str(view.get(key, "")).strip("/") for key in ("local_path", "filename"))
    name = "/".join(filter(None, parts))
    where = f"{path}: {faults.shown(view['filename'])}"
    if "focal_length" not in lens:
        raise ValueError(f"{where}: no lens of a focal length, as of a panorama")
    key = next((key for key in LENSES if key in lens), None)
    count, model = LENSES.get(key, (0, "PINHOLE"))
    json_files.check(
        lens, LENS | ({key: json_files.vector(count)} if key else {}), where
    )
    json_files.check(pose, POSE, where)
    params = lens[key] if key else []
    if model == "FULL_OPENCV":
        k1, k2, k3, *t = params
        params = [k1, k2, *(t or (0.0, 0.0)), k3, 0.0, 0.0, 0.0]
    focals = [lens["focal_length"]] * (1 if key == "disto_k1" else 2)
    own = shots.lens(where, model, [*focals, *lens["principal_point"], *params])
    turn = np.transpose(pose["rotation"])
    size = float(lens["width"]), float(lens["height"])
    return shots.Shot(name, own, shots.pose(turn, pose["center"]), size)
