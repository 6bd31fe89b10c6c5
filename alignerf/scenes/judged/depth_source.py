"""Where the depth of a scene that is judged comes from, and what told its unit."""

import logging

import numpy as np

from alignerf.captures import base
from alignerf.files import faults
from alignerf.scenes.judged import depths
from alignerf.scenes.judged.pairs import Judged

log = logging.getLogger("alignerf")


def of_depth(config, judged: Judged, views, shown):
    """What is told of depth: where it comes from, its kind and unit, and the files."""
    points = None if views.points is None else views.points[0]
    if (keys := base.section(config, "judged"))["depth"]:
        return of_given_depth(keys, views, shown, points)
    if judged.cameras.kind == "none" or points is None:
        return {"depth": "far"}
    return {"depth": "points"}


def of_given_depth(keys, views, shown, points):
    """The same where depth came along; keys: those of `judged`.

    depth_unit: what told the unit, `points`, `config` or `nothing`.
    """
    paths = depths.find(keys["depth"], views.names)
    if missing := [name for name in views.names if name not in paths]:
        log.warning(
            "%d of %d views have no depth, and all that they see counts as far away: "
            "%s",
            *(len(missing), len(views.names), faults.some_names(missing)),
        )
    cameras = zip(views.names, views.pixtocams, views.camtoworlds, strict=True)
    size = views.width, views.height
    by_name = {n: (*camera, size, shown[n].render_lens) for n, *camera in cameras}
    unit = depths.unit_of(paths, by_name, points)
    told_by = "nothing" if np.isnan(unit.spread) else "points"
    if keys["depth_kind"]:
        unit = unit._replace(kind=keys["depth_kind"])
    if keys["depth_scale"]:
        unit, told_by = unit._replace(scale=keys["depth_scale"]), "config"
    if told_by == "nothing":
        log.warning(
            "%s: too few points came with the cameras to tell the unit of depth: it is "
            "taken for theirs",
            keys["depth"],
        )
    return {
        "depth": "given",
        "depth_kind": unit.kind,
        "depth_scale": unit.scale,
        "depth_spread": None if np.isnan(unit.spread) else unit.spread,
        "depth_unit": told_by,
        "depths": {name: str(path) for name, path in paths.items()},
    }
