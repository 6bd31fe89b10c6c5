"""Points of a scene whose cameras are given: COLMAP's features, and no camera moves.

The nearest and farthest depths decide settings. The points' reprojection error tells,
before any training, how exact the cameras are.
"""

from pathlib import Path

import pycolmap

from alignerf.files import progress
from alignerf.scenes import colmap, exported
from alignerf.scenes.capture import mapping

# Features of a view: enough to see how near things are, and matched in a sixteenth of
# the time that COLMAP's usual 8192 take.
MOST_FEATURES = 2048


def triangulate(image_folder, work_folder, views, *, seed) -> colmap.Reconstruction:
    """The given views and their triangulated points, the same on every run.

    views: the arrays of a cameras.npz; image_folder: <view>.png of their size. Writes
    into work_folder. There may be no point; their mean error is then 0.
    """
    names = sorted(views["names"].tolist())
    database, out = Path(work_folder) / "given.db", Path(work_folder) / "given"
    out.mkdir()
    model = exported.model_of(views)
    mapping.quiet(seed)
    write_views(database, model)
    with progress.heartbeat("COLMAP: features"):
        side_px = int(max(views["width"], views["height"]))
        mapping.extract(database, image_folder, names, side_px, most=MOST_FEATURES)
    with progress.heartbeat("COLMAP: matching"):
        mapping.match(database, len(names), seed)
    with progress.heartbeat("COLMAP: points"):
        options = mapping.pipeline_options(seed)
        triangulated = pycolmap.triangulate_points(
            model, database, image_folder, out, options=options
        )
    return colmap.convert(triangulated, names)


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
