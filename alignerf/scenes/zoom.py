"""Windows of a scene's photos as its views: chosen here, cut by `capture.windows`."""

import logging

import numpy as np

from alignerf.files import json_files
from alignerf.scenes import cameras, loading
from alignerf.scenes.capture import windows

log = logging.getLogger("alignerf.poses")


def zoomed(views, config):
    """The windows as views, where they lie, and what the report says of them."""
    zoom, least = config["zoom"], config["least_train_views"] + 1
    where = config["path"] or config["source"]
    try:
        point = windows.place(views, zoom, least=least)
        cut = windows.around(point, views, zoom["px"], least=least)
    except ValueError as error:
        raise ValueError(f"{where}: zoom: {error}") from None
    kept = {"views": len(cut.kept), "of": len(views.names)}
    log.info(
        "%s: windows of %d px around %s, in %d of %d views",
        *(where, zoom["px"], np.round(point, 4).tolist(), *kept.values()),
    )
    of_zoom = {"px": zoom["px"], "point": point.tolist(), **kept}
    return windows.cut(views, cut), cut, {"zoom": of_zoom}


def placed(views, config, places):
    """(views with their points, places [k, 3], px) of the windows of a whole scene."""
    if places:
        views = views._replace(points=loading.points_of(places))
        there = json_files.read(places / "poses.json", {"zoom": dict})["zoom"]
        return views, np.array(there["points"]), there["px"]
    views = with_focus(views)
    least = config["least_train_views"] + 1
    return views, *windows.places(views, config["zoom"], least=least)


def around(views, points, px, *, least):
    """(places, their `windows.Windows`) of those seen by views of both splits.

    Raises ValueError where there is none.
    """
    found = []
    for point in points:
        try:
            one = windows.around(point, views, px, least=least)
        except ValueError as error:
            log.warning("%s", error)
            continue
        one = windows.that_count(views, one)
        split = views.split[one.kept]
        if (split == "train").sum() >= least - 1 and (split == "test").any():
            found.append((np.asarray(point).tolist(), one))
    if not found:
        what = "seen by enough photos to learn from and to judge by"
        raise ValueError(f"no place is {what}")
    return [point for point, _ in found], [one for _, one in found]


def with_focus(views):
    """The views, where they share no points, with the one that they all look at."""
    focus = cameras.focus_of(views.camtoworlds)
    if views.points is not None or focus is None:
        return views
    return views._replace(points=(focus[None], np.zeros((1, 3), np.uint8)))
