"""A scene's folder for other programs: nerfstudio's transforms.json, COLMAP's model.

Both in one folder, beside `images/`: nerfstudio and its kin read `transforms.json`,
Gaussian splatting and COLMAP read `sparse/0`. Cameras are pinholes with pixel centres
at +0.5, in the frame in which the scene's cameras were given.
"""

import json
from pathlib import Path

import numpy as np
import pycolmap

from alignerf.scenes import cameras

POINTS = "points.ply"


def write_transforms(path, found, *, masks=()):
    """Write transforms.json of cameras as `prepared.read_cameras` has them.

    Images are named images/<view>.png; with `points` [m, 3] and `colours` among the
    arrays these are in points.ply beside it. masks: views that have a
    masks/<view>.png, black where a pixel is not to be learnt from.
    """
    camtopix = np.linalg.inv(found["pixtocams"])
    frames = []
    for name, matrix, pose in zip(
        found["names"].tolist(), camtopix, found["camtoworlds"], strict=True
    ):
        frame = {
            "file_path": f"images/{name}.png",
            "fl_x": matrix[0, 0],
            "fl_y": matrix[1, 1],
            "cx": matrix[0, 2],
            "cy": matrix[1, 2],
            "transform_matrix": [*pose.tolist(), [0.0, 0.0, 0.0, 1.0]],
        }
        if name in masks:
            frame["mask_path"] = f"masks/{name}.png"
        frames.append(frame)
    files = {
        f"{split}_filenames": [
            frame["file_path"]
            for frame, own in zip(frames, found["split"].tolist(), strict=True)
            if own == split
        ]
        for split in ("train", "test")
    }
    scene = {
        "camera_model": "PINHOLE",
        "w": int(found["width"]),
        "h": int(found["height"]),
        **files,
        # nerfstudio looks at views of this name while it trains.
        "val_filenames": files["test_filenames"],
        "frames": frames,
    }
    if "points" in found:
        scene["ply_file_path"] = POINTS
        write_points(Path(path).parent / POINTS, found["points"], found["colours"])
    Path(path).write_text(json.dumps(scene, indent=1) + "\n", encoding="utf-8")


def write_points(path, points, colours):
    """Write points [m, 3] and their colours [m, 3] uint8 as PLY, as text."""
    kinds = [*(f"float {axis}" for axis in "xyz")]
    kinds += [f"uchar {name}" for name in ("red", "green", "blue")]
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    head += [*(f"property {kind}" for kind in kinds), "end_header"]
    rows = [
        " ".join([*(f"{value:.9g}" for value in point), *map(str, colour)])
        for point, colour in zip(points.tolist(), colours.tolist(), strict=True)
    ]
    Path(path).write_text("\n".join([*head, *rows]) + "\n", encoding="ascii")


def write_colmap(folder, found):
    """Write cameras.bin, images.bin and points3D.bin of the same arrays.

    Views that share their intrinsics share a camera. Points do not know the views that
    they were seen in.
    """
    Path(folder).mkdir(parents=True)
    model, camera_ids = pycolmap.Reconstruction(), {}
    size = {"width": int(found["width"]), "height": int(found["height"])}
    views = zip(
        found["names"].tolist(), found["pixtocams"], found["camtoworlds"], strict=True
    )
    for number, (name, pixtocam, pose) in enumerate(views, start=1):
        matrix = np.linalg.inv(pixtocam)
        lens = tuple(float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
        if lens not in camera_ids:
            camera_ids[lens] = len(camera_ids) + 1
            camera = pycolmap.Camera(
                model="PINHOLE", params=lens, camera_id=camera_ids[lens], **size
            )
            model.add_camera_with_trivial_rig(camera)
        image = pycolmap.Image(
            name=f"{name}.png", camera_id=camera_ids[lens], image_id=number
        )
        turn = (pose[:, :3] @ cameras.OPENGL_FROM_OPENCV).T
        moved = pycolmap.Rigid3d(pycolmap.Rotation3d(turn), -turn @ pose[:, 3])
        model.add_image_with_trivial_frame(image, moved)
    for point, colour in zip(
        found.get("points", ()), found.get("colours", ()), strict=True
    ):
        model.add_point3D(point, pycolmap.Track(), colour)
    model.write(folder)
