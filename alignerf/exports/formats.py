"""The formats of an export: nerfstudio's transforms.json, COLMAP's model, others.

Both in one folder, beside `images/`: nerfstudio and its kin read `transforms.json`,
Gaussian splatting and COLMAP read `sparse/0`. What came as LLFF's `poses_bounds.npy` or
as one of NeRF's synthetic scenes goes as that too. Cameras are pinholes with pixel
centres at +0.5, in the frame in which the scene's cameras were given.
"""

import json
from pathlib import Path

import numpy as np

from alignerf.scenes import cameras
from alignerf.scenes.formats import llff

# Beside transforms.json, for programs that begin with points.
POINTS = "points.ply"
# Under the name that COLMAP looks for; nerfstudio takes what transforms.json names.
MASK = "masks/{view}.png.png"
# What a frame says whose camera saw the photo that it is judged by.
FITTED = "fitted to its own photo"


def write_transforms(path, arrays, *, masked=False, points=False, fitted=()):
    """Write transforms.json; returns its content.

    arrays: as of `prepared.read_cameras`. Images are named images/<view>.png. masked:
    each view has a MASK, black where a pixel is not to be learnt from. points: whether
    `write_colmap` writes POINTS. fitted: names of the views whose cameras are FITTED.
    """
    camtopix = np.linalg.inv(arrays["pixtocams"])
    views = zip(arrays["names"].tolist(), camtopix, arrays["camtoworlds"], strict=True)
    frames = [frame_of(*view, masked=masked, fitted=fitted) for view in views]
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
    if points:
        scene["ply_file_path"] = POINTS
    write_json(path, scene)
    return scene


def frame_of(name, camtopix, pose, *, masked, fitted):
    """A view's entry of transforms.json; arguments: as of `write_transforms`."""
    frame = {
        "file_path": f"images/{name}.png",
        "fl_x": camtopix[0, 0],
        "fl_y": camtopix[1, 1],
        "cx": camtopix[0, 2],
        "cy": camtopix[1, 2],
        "transform_matrix": [*pose.tolist(), [0.0, 0.0, 0.0, 1.0]],
    }
    if masked:
        frame["mask_path"] = MASK.format(view=name)
    if name in fitted:
        frame["camera"] = FITTED
    return frame


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


def write_colmap(folder, model, arrays):
    """Write COLMAP's model: sparse/0 and, where it has points, POINTS.

    model: a pycolmap.Reconstruction of the arrays' views. sparse/0/test.txt names the
    photos that are held out, as Gaussian splatting reads them.
    """
    sparse = Path(folder) / "sparse" / "0"
    sparse.mkdir(parents=True)
    model.write(sparse)
    if model.num_points3D():
        model.export_PLY(Path(folder) / POINTS)
    held_out = arrays["names"][arrays["split"] == "test"].tolist()
    lines = "".join(f"{name}.png\n" for name in held_out)
    (sparse / "test.txt").write_text(lines, encoding="utf-8")


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
