"""Photos, renders and cameras of another program put together: source `judged`.

Each photo becomes the picture that its render shows, at the render's size (see
`geometry`). What the importer of renders has to know lies in images/pairs.json.
"""

import functools
import json
import logging
from pathlib import Path

import cv2
import numpy as np

from alignerf.captures import base
from alignerf.files import faults, images, json_files
from alignerf.scenes import photos, prepare, prepared
from alignerf.scenes.judged import depths, geometry, pairs, renders
from alignerf.scenes.judged.pairs import Judged, Pair

log = logging.getLogger("alignerf")

# Below the prepared scene's folder.
PAIRS = "images/pairs.json"
# Pairs by which the geometry is chosen.
SAMPLES = 6
# A render's black border is one from this share of its pixels on.
BORDER_SHARE = 0.001


def read_photo(path, upright, background):
    return photos.decode(path, background, upright=upright)[0]


def read_render(render: renders.Render, background=None):
    """(the render [h, w, 3], where it counts [h, w]): not where it has nothing.

    Left out are a black border and, where no background is given, what is transparent.
    """
    image = photos.as_stored(render.path, background or "black")
    counts = ~border(image)
    if background is None and photos.may_be_transparent(render.path):
        # What lies behind shows through.
        counts &= (image == photos.as_stored(render.path, "white")).all(axis=-1)
    if render.is_sheet:
        image, counts = (one[:, one.shape[1] // 2 :] for one in (image, counts))
    return np.ascontiguousarray(image), counts


def border(image):
    """Mask [h, w] of black pixels that reach the image's edge without a gap."""
    black = (image == 0).all(axis=-1).astype(np.uint8)
    count, labels = cv2.connectedComponents(black, connectivity=4)
    if count == 1:
        return np.zeros(black.shape, bool)
    edge = [labels[0], labels[-1], labels[:, 0], labels[:, -1]]
    outer = np.setdiff1d(np.unique(np.concatenate(edge)), [0])
    found = np.isin(labels, outer)
    return found if found.mean() > BORDER_SHARE else np.zeros_like(found)


def ways_of(pair: Pair, size):
    return geometry.ways(pair.lens, pair.photo_size, size, pair.render.path)


def chosen_way(judged: Judged, background):
    """(name of the way that fits, {way: px}) by some of the pairs."""
    step = max(len(judged.pairs) // SAMPLES, 1)

    def samples():
        for pair in judged.pairs[::step][:SAMPLES]:
            photo = read_photo(pair.photo, pair.upright, background)
            render = read_render(pair.render, background)[0]
            yield photo, render, ways_of(pair, judged.size)

    return geometry.choose(samples())


def shown_of(pair: Pair, size, way):
    """The `geometry.Shown` of a pair; of lenses without that way, the first."""
    found = ways_of(pair, size)
    return next((shown for shown in found if shown.way == way), found[0])


def load(config, scratch):
    """Reader of source `judged`: (views at the renders' size, report, no truth)."""
    judged = pairs.find(config)
    way, apart = chosen_way(judged, config["background"])
    log.info("%d pairs, renders %s", len(judged.pairs), judged.told["layout"])
    log.info("renders show photos %s", geometry.WAYS[way])
    shown = {pair.name: shown_of(pair, judged.size, way) for pair in judged.pairs}
    views = posed(judged, shown, config["background"])
    keys = base.section(config, "judged")
    prepared.check_views(keys["cameras"] or config["path"], views)
    told = judged.told | {"way": way, "apart_px": apart}
    told |= {"background": config["background"]}
    renders_of = [pair.render.path for pair in judged.pairs]
    told["transparent"] = any(map(photos.may_be_transparent, renders_of))
    told |= of_depth(config, judged, views, shown)
    beside = scratch / prepared.BESIDE
    beside.mkdir()
    (beside / "pairs.json").write_text(json.dumps(pairs_json(judged, shown, told)))
    report = {
        "registered": len(judged.pairs),
        "total": len(judged.pairs) + len(judged.told["without_render"]),
        "left_out": judged.told["without_render"],
        "mean_reprojection_error_px": None,
        "points": None if views.points is None else len(views.points[0]),
        "models": None,
        "judged": told,
        "files": pairs.files_of(judged, keys),
    }
    sizes = [pair.photo_size for pair in judged.pairs]
    report["photo_size"] = list(max(set(sizes), key=sizes.count))
    return views, report, None


def posed(judged: Judged, shown, background) -> prepare.PosedViews:
    """The views: photos as the renders show them, where both have pixels."""
    own = judged.pairs
    splits = pairs.splits_of(judged)
    return prepare.PosedViews(
        names=[pair.name for pair in own],
        pixtocams=np.stack([geometry.pixtocam(shown[pair.name]) for pair in own]),
        camtoworlds=np.stack([pair.pose for pair in own]),
        width=judged.size[0],
        height=judged.size[1],
        photos=[photo_step(pair, shown[pair.name], background) for pair in own],
        masks=[
            prepare.Photo(
                pair,
                (mask_step(shown[pair.name], background),),
                pair.render.path,
            )
            for pair in own
        ],
        points=judged.cameras.points,
        split=np.array([splits[pair.name] for pair in own]),
    )


def at_full_size(config):
    """(the views as large as most photos allow, []): for exports.

    The way is the one that `load` has found, by the same pairs.
    """
    judged = pairs.find(config)
    way, _ = chosen_way(judged, config["background"])
    shown = {pair.name: shown_of(pair, judged.size, way) for pair in judged.pairs}
    sizes = list(map(geometry.photos_size, shown.values()))
    size = max(set(sizes), key=lambda one: (sizes.count(one), one))
    large = {name: geometry.at_size(one, size) for name, one in shown.items()}
    views = posed(judged._replace(size=size), large, config["background"])
    masks = None
    if not all(one.inside().all() for one in shown.values()):
        # Beyond the photo its border is repeated, which is nothing to learn from.
        masks = [prepare.Photo(large[name], (inside_of,)) for name in views.names]
    return views._replace(masks=masks), []


def inside_of(shown):
    """An image of the mask [h, w, 3] of what a photo shows of its picture."""
    return images.of_mask(shown.inside())


def photo_step(pair: Pair, shown, background):
    """A photo that becomes the picture of its render when it is read."""
    read = functools.partial(read_photo, upright=pair.upright, background=background)
    return prepare.Photo(pair.photo, (read, shown.picture))


def mask_step(shown, background):
    return functools.partial(mask_of, shown=shown, background=background)


def mask_of(pair: Pair, shown, background=None):
    """255 where photo and render of a pair both have a pixel [h, w, 3].

    Raises ValueError naming a render that has nothing.
    """
    _, counts = read_render(pair.render, background)
    if not counts.any():
        raise ValueError(
            f"{pair.render.path}: an empty image, all black or transparent: take it "
            "away, or render it again"
        )
    counts = shown.render(
        np.where(counts[..., None], 255, 0).astype(np.uint8).repeat(3, -1)
    )
    counts = (counts >= prepare.WHITE).all(axis=-1) & shown.inside()
    return images.of_mask(counts)


def pairs_json(judged: Judged, shown, told):
    """What the importer of the renders reads: `read_pairs`."""
    of_views = {}
    for pair in judged.pairs:
        lens = shown[pair.name].render_lens
        of_views[pair.name] = {
            "render": str(pair.render.path),
            "is_sheet": pair.render.is_sheet,
            "lens": lens and [lens[0].tolist(), lens[1].tolist()],
            "depth": told.get("depths", {}).get(pair.name),
        }
    told.pop("depths", None)
    keys = ("depth", "depth_kind", "depth_scale", "background")
    return {"views": of_views} | {key: told.get(key) for key in keys}


def read_pairs(scene):
    """The contents of images/pairs.json of a prepared scene; None without one."""
    path = Path(scene) / PAIRS
    if not path.is_file():
        return None
    return json_files.read(path, {"views": dict, "depth": str})


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
