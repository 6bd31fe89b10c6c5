"""A scene's folder for other programs: nerfstudio's transforms.json, COLMAP's model.

Both in one folder, beside `images/`: nerfstudio and its kin read `transforms.json`,
Gaussian splatting and COLMAP read `sparse/0`. What came as LLFF's `poses_bounds.npy` or
as one of NeRF's synthetic scenes goes as that too. Cameras are pinholes with pixel
centres at +0.5, in the frame in which the scene's cameras were given.
"""

import json
from pathlib import Path

import numpy as np
import pycolmap

from alignerf.scenes import cameras, llff

# Beside transforms.json, for programs that begin with points.
POINTS = "points.ply"


def write_transforms(path, arrays, *, masked=False):
    """Write transforms.json; returns its content.

    arrays: as of `prepared.read_cameras`, with `points` where `write_colmap` writes
    POINTS. Images are named images/<view>.png. masked: each view has a
    masks/<view>.png, black where a pixel is not to be learnt from.
    """
    camtopix = np.linalg.inv(arrays["pixtocams"])
    frames = []
    for name, matrix, pose in zip(
        arrays["names"].tolist(), camtopix, arrays["camtoworlds"], strict=True
    ):
        frame = {
            "file_path": f"images/{name}.png",
            "fl_x": matrix[0, 0],
            "fl_y": matrix[1, 1],
            "cx": matrix[0, 2],
            "cy": matrix[1, 2],
            "transform_matrix": [*pose.tolist(), [0.0, 0.0, 0.0, 1.0]],
        }
        if masked:
            frame["mask_path"] = f"masks/{name}.png"
        frames.append(frame)
    files = {
        f"{split}_filenames": [
            frame["file_path"]
            for frame, own in zip(frames, arrays["split"].tolist(), strict=True)
            if own == split
        ]
        for split in ("train", "test")
    }
    scene = {
        "camera_model": "PINHOLE",
        "w": int(arrays["width"]),
        "h": int(arrays["height"]),
        **files,
        # nerfstudio looks at views of this name while it trains.
        "val_filenames": files["test_filenames"],
        "frames": frames,
    }
    if "points" in arrays:
        scene["ply_file_path"] = POINTS
    write_json(path, scene)
    return scene


def write_blender(folder, arrays, scene):
    """Write transforms_train.json, _val.json and _test.json, as NeRF's scenes have.

    scene: what `write_transforms` wrote of the same arrays. Photos are named without
    their suffix; the views of `val` are those of `test`. Raises ValueError where one
    field of view does not say all lenses: the format has no more.
    """
    focal_px = one_focal_length(arrays)
    size = arrays["width"], arrays["height"]
    centred = np.linalg.inv(cameras.intrinsics(focal_px, *size))
    if np.abs(np.linalg.inv(arrays["pixtocams"][0]) - centred).max() > 1e-6 * focal_px:
        raise ValueError("the principal point is not the photo's middle")
    shared = {key: scene[key] for key in ("camera_model", "w", "h")}
    shared["camera_angle_x"] = 2 * float(np.arctan(0.5 * scene["w"] / focal_px))
    for split in ("train", "val", "test"):
        chosen = set(scene[f"{split}_filenames"])
        frames = [
            frame | {"file_path": frame["file_path"].removesuffix(".png")}
            for frame in scene["frames"]
            if frame["file_path"] in chosen
        ]
        path = Path(folder) / f"transforms_{split}.json"
        write_json(path, shared | {"frames": frames})


def one_focal_length(arrays):
    """The focal length of all views in px; ValueError where views or axes differ."""
    lenses = np.linalg.inv(arrays["pixtocams"])
    if np.ptp(lenses, axis=0).max() > 1e-9:
        raise ValueError("the views' lenses differ")
    focal_px = float(lenses[0, 0, 0])
    if abs(lenses[0, 1, 1] / focal_px - 1) > 1e-6:
        raise ValueError("focal lengths differ along and across the rows")
    return focal_px


def write_json(path, content):
    """Write JSON for another program."""
    Path(path).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def write_colmap(folder, arrays):
    """Write COLMAP's model of the arrays: sparse/0 and, of its points, POINTS.

    `points` [m, 3] and `colours` may be among the arrays; the points have no tracks.
    """
    sparse = Path(folder) / "sparse" / "0"
    sparse.mkdir(parents=True)
    model = model_of(arrays)
    if "points" in arrays:
        for point, colour in zip(arrays["points"], arrays["colours"], strict=True):
            model.add_point3D(point, pycolmap.Track(), colour)
        model.export_PLY(Path(folder) / POINTS)
    model.write(sparse)


def model_of(arrays) -> pycolmap.Reconstruction:
    """COLMAP's model of the arrays of a cameras.npz, without points.

    Views that share their intrinsics share a camera.
    """
    model, camera_ids = pycolmap.Reconstruction(), {}
    size = {"width": int(arrays["width"]), "height": int(arrays["height"])}
    names = arrays["names"].tolist()
    views = zip(names, arrays["pixtocams"], arrays["camtoworlds"], strict=True)
    for number, (name, pixtocam, pose) in enumerate(views, start=1):
        matrix = np.linalg.inv(pixtocam)
        # Rounding makes no other lens.
        lens = tuple(
            round(float(matrix[at]), 9) for at in ((0, 0), (1, 1), (0, 2), (1, 2))
        )
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
    return model


def write_llff(path, arrays, bounds):
    """Write poses_bounds.npy of the same arrays, beside `write_colmap`'s sparse/0.

    bounds [n, 2]: nearest and farthest depth of each view. Raises ValueError where
    views differ in their lens, or one focal length does not say it: the format has no
    more. The principal point stands in sparse/0.
    """
    focal_px = one_focal_length(arrays)
    lens = np.array([arrays["height"], arrays["width"], focal_px], np.float64)
    # In the order of the file names, which is not that of the names alone.
    order = sorted(range(len(bounds)), key=lambda i: f"{arrays['names'][i]}.png")
    rows = []
    for pose, depths in zip(arrays["camtoworlds"][order], bounds[order], strict=True):
        turn = pose[:, :3] @ llff.LLFF_FROM_OPENGL.T
        matrix = np.concatenate([turn, pose[:, 3:], lens[:, None]], axis=-1)
        rows.append(np.concatenate([matrix.ravel(), depths]))
    np.save(path, np.stack(rows))
