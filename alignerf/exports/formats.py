"""The formats of an export: nerfstudio's transforms.json and COLMAP's model.

Both in one folder, beside `images/`: nerfstudio and its kin read `transforms.json`,
Gaussian splatting and COLMAP read `sparse/0`. Cameras are pinholes with pixel centres
at +0.5, in the frame in which the scene's cameras were given.
"""

import json
from pathlib import Path

import numpy as np

# Beside transforms.json, for programs that begin with points.
POINTS = "points.ply"
# Under the name that COLMAP looks for; nerfstudio takes what transforms.json names.
MASK = "masks/{view}.png.png"
# What a frame says whose camera saw the photo that it is judged by.
FITTED = "fitted to its own photo"


def write_transforms(path, arrays, *, masked=False, points=False, fitted=()):
    """Write transforms.json.

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
    Path(path).write_text(json.dumps(scene, indent=1) + "\n", encoding="utf-8")


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
