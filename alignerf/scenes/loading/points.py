"""The points that a scene's views share, where its cameras have come without any."""

import logging

import numpy as np

from alignerf.files import archives
from alignerf.scenes import prepare, prepared
from alignerf.scenes.capture import report, triangulate

log = logging.getLogger("alignerf.poses")
# Of the photos in which points are found to choose windows by.
OF_POINTS = (12_000_000, 300)


def with_points(views, scratch, config):
    """The views with the points that they share, found in smaller photos; the report.

    scratch: a folder, written into.
    """
    folder, every = scratch / "whole", np.full(len(views.names), "train")
    small = prepare.downscale(views, prepare.factor_for(views, *OF_POINTS))
    prepare.write_views(folder, small, split=every)
    told = add_points(folder, scratch, views.width / small.width, config)
    if told:
        arrays = archives.read(folder / prepared.POINTS, ["points", "colours"])
        views = views._replace(points=(arrays["points"], arrays["colours"]))
    return views, told


def add_points(fresh, scratch, photo_scale, config):
    """Triangulate the points that the views share; returns the report's part on points.

    photo_scale: a photo's width over its view's; errors of the report are in pixels of
    the photo.
    """
    views = prepared.read_cameras(fresh / "cameras.npz")
    points3d = triangulate.triangulate(
        fresh / "images", scratch, views, seed=config["seed"]
    )
    if not len(points3d.points):
        log.warning("%s: its views share no points", config["path"] or config["source"])
        return {}
    points = fresh / prepared.POINTS
    np.savez(points, points=points3d.points, colours=points3d.colours)
    log.info(
        "%d points, which the given cameras see %.2f px from where they are found",
        *(len(points3d.points), points3d.mean_reprojection_error_px),
    )
    points3d = points3d.of_size(np.full((len(points3d.names), 2), photo_scale))
    return report.points(points3d)
