"""Points of a scene whose cameras are given: COLMAP's features, and no camera moves.

The nearest and farthest depths decide settings. The points' reprojection error tells,
before any training, how exact the cameras are.
"""

from pathlib import Path

import numpy as np
import pycolmap

from alignerf.colmap import mapping, structure
from alignerf.io import progress
from alignerf.scenes import cameras

# Features of a view: enough to see how near things are, and matched in a sixteenth of
# the time that COLMAP's usual 8192 take.
MAX_FEATURES = 2048


def triangulate(
    image_folder,
    work_folder,
    views,
    *,
    seed,
    max_side_px=None,
    max_features=MAX_FEATURES,
    masks=None,
) -> structure.Reconstruction:
    """The given views and their triangulated points, the same on every run.

    views: the arrays of a cameras.npz; image_folder: <view>.png of their size. Features
    are found in photos of at most max_side_px, where `masks` (folder of
    <view>.png.png) are not black. Writes into work_folder. There may be no point; their
    mean error is then 0.
    """
    names = sorted(views["names"].tolist())
    database, out = Path(work_folder) / "given.db", Path(work_folder) / "given"
    out.mkdir()
    model = model_of(views)
    pycolmap.set_random_seed(seed)
    with mapping.room_for(database):
        write_views(database, model)
        side_px = max_side_px or int(max(views["width"], views["height"]))
        options = {"max_size_px": side_px, "masks": masks, "most": max_features}
        mapping.find_matches(database, image_folder, names, seed=seed, **options)
        with progress.heartbeat("COLMAP: points"):
            options = mapping.pipeline_options(seed)
            triangulated = pycolmap.triangulate_points(
                model, database, image_folder, out, options=options
            )
    return structure.convert(triangulated, names)


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
        # Rounded, so that the noise of floats makes no further lens.
        lens = tuple(
            round(float(matrix[at]), 9) for at in ((0, 0), (1, 1), (0, 2), (1, 2))
        )
        if lens not in camera_ids:
            camera_ids[lens] = len(camera_ids) + 1
            camera = pycolmap.Camera(
                model="PINHOLE", params=lens, camera_id=camera_ids[lens], **size
            )
            model.add_camera_with_trivial_rig(camera)
        add_image(model, name, number, camera_ids[lens], pose)
    return model


def add_image(model, name, number, camera_id, pose):
    """Add a view <name>.png of a camera-to-world pose [3, 4] to COLMAP's model."""
    image = pycolmap.Image(name=f"{name}.png", camera_id=camera_id, image_id=number)
    turn = (pose[:, :3] @ cameras.OPENGL_FROM_OPENCV).T
    moved = pycolmap.Rigid3d(pycolmap.Rotation3d(turn), -turn @ pose[:, 3])
    model.add_image_with_trivial_frame(image, moved)


def write_views(database, model):
    """A database of a model's views, under the numbers that the model has for them."""
    with pycolmap.Database.open(database) as file:
        for camera in model.cameras.values():
            file.write_camera(camera, use_camera_id=True)
        for rig in model.rigs.values():
            file.write_rig(rig, use_rig_id=True)
        for frame in model.frames.values():
            file.write_frame(frame, use_frame_id=True)
        for image in model.images.values():
            file.write_image(image, use_image_id=True)
