"""Points of an export, with which Gaussian splatting begins.

Cameras that have moved see the scene's points elsewhere than their photos do. Points
are then triangulated anew: features of the exported photos, cameras held.
"""

import logging

import numpy as np
import pycolmap

from alignerf.colmap import triangulate
from alignerf.sfm import calibration, checking

log = logging.getLogger("alignerf")

# As COLMAP takes photos for poses (`colmap.max_size_px`), and half as many features as
# its usual: pairs are matched in a quarter of the time.
MAX_SIDE_PX, MAX_FEATURES = 1600, 4096


def anew(folder, work_folder, arrays, views, *, seed) -> pycolmap.Reconstruction:
    """COLMAP's model of the arrays, with points and tracks that some views share.

    folder: of the export, with images/ and maybe masks/. arrays: of its cameras.npz.
    views: indices of those whose cameras agree with each other.
    """
    each = {k: arrays[k][views] for k in ("names", "pixtocams", "camtoworlds")}
    masks = folder / "masks"
    found = triangulate.triangulate(
        folder / "images",
        work_folder,
        each | {k: arrays[k] for k in ("width", "height")},
        seed=seed,
        max_side_px=MAX_SIDE_PX,
        max_features=MAX_FEATURES,
        masks=masks if masks.is_dir() else None,
    )
    model = triangulate.model_of(arrays)
    add_tracks(model, found.of_colmap)
    log.info(
        "%d points, which the exported cameras see %.2f px from where they are found",
        *(len(found.points), found.mean_reprojection_error_px),
    )
    return model


def add_tracks(model, found):
    """Add the points of a model of some of the views, and where these see them."""
    numbers = {image.name: number for number, image in model.images.items()}
    for image in found.images.values():
        places = [pycolmap.Point2D(point.xy) for point in image.points2D]
        model.images[numbers[image.name]].points2D = pycolmap.Point2DList(places)
    for point in found.points3D.values():
        track = pycolmap.Track()
        for seen in point.track.elements:
            name = found.images[seen.image_id].name
            track.add_element(numbers[name], seen.point2D_idx)
        model.add_point3D(point.xyz, track, point.color)
    model.update_point_3d_errors()


def of_matches(arrays, checked, work, seed) -> pycolmap.Reconstruction:
    """COLMAP's model of the arrays, with the points and tracks of `checking.check`.

    arrays: of the views that were checked, by the cameras that it has found.
    """
    found = checked.found
    if found:
        seen, cameras = found.model, found.cameras
    else:
        _, seen = checking.triangulated(checked, work, seed)
        cameras = checked.given
    model = triangulate.model_of(arrays)
    # Px of the matches in those of pinholes whose lens was undone.
    to_views = np.linalg.inv(arrays["pixtocams"]) @ cameras.pixtocams
    lenses = zip(cameras.camtopix, cameras.distortion, strict=True)
    for view, lens in enumerate(lenses):
        # Those that are aligned are no longer the matches'.
        points = seen.images[view + 1].points2D if view + 1 in seen.images else []
        xy = np.array([point.xy for point in points]).reshape(-1, 2)
        xy = calibration.pinhole_points(xy, *lens)
        moved = xy @ to_views[view, :2, :2].T + to_views[view, :2, 2]
        places = [pycolmap.Point2D(one) for one in moved]
        model.images[view + 1].points2D = pycolmap.Point2DList(places)
    for point in seen.points3D.values():
        model.add_point3D(point.xyz, point.track, point.color)
    model.update_point_3d_errors()
    return model


def given(arrays, points) -> pycolmap.Reconstruction:
    """COLMAP's model of the arrays with the scene's points, or none; without tracks.

    points: positions and colours, or None.
    """
    model = triangulate.model_of(arrays)
    for position, colour in zip(*(points or ([], [])), strict=True):
        model.add_point3D(position, pycolmap.Track(), colour)
    return model


def of(folder, work_folder, arrays, scene_points, *, seed, moved, views):
    """(COLMAP's model of the arrays with points, how these came about, in words).

    scene_points: positions and colours, or None. moved: whether the cameras are others
    than those that the scene's points are of. views: as of `anew`.
    """
    if scene_points is not None and not moved:
        return given(arrays, scene_points), "the scene's own, of the cameras as given"
    if len(views) > 1:
        model = anew(folder, work_folder, arrays, views, seed=seed)
        if model.num_points3D():
            return model, f"triangulated anew from {len(views)} photos and cameras here"
    if scene_points is not None:
        log.warning("no points by the exported cameras: the scene's own go out")
        return given(arrays, scene_points), "the scene's own, of the cameras as given"
    log.warning("the views share no points: Gaussian splatting cannot begin with any")
    return given(arrays, None), ""


def agreeing(arrays, fitted):
    """Indices of the views whose cameras agree: training views, and fitted ones."""
    train = arrays["split"] == "train"
    return np.flatnonzero(train | np.isin(arrays["names"], list(fitted)))
