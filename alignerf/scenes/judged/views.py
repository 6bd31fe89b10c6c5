"""Photos, renders and cameras of another program put together: source `judged`.

Each photo becomes the picture that its render shows, at the render's size (see
`geometry`). What the importer of renders has to know lies in images/pairs.json.
"""

import functools
import json
import logging
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from alignerf.files import faults, json_files
from alignerf.scenes import photos, prepare
from alignerf.scenes.judged import depths, geometry, lenses, renders

log = logging.getLogger("alignerf")

# Below the prepared scene's folder.
PAIRS = "images/pairs.json"
# Pairs by which the geometry is chosen.
SAMPLES = 6
# A render's black border is one from this share of its pixels on.
BORDER_SHARE = 0.001
# Where the photos lie in a folder.
OF_PHOTOS = (".", "images", "input", "rgb")


class Pair(NamedTuple):
    """A view: its photo's path, its render, its lens at the photo's size."""

    name: str
    photo: Path
    upright: bool
    render: renders.Render
    lens: tuple
    photo_size: tuple
    pose: np.ndarray


class Judged(NamedTuple):
    """All pairs of a project, one size of renders, and what is told of it."""

    pairs: list
    size: tuple
    cameras: lenses.Cameras
    told: dict


def find(config) -> Judged:
    """The pairs of a scene's keys. Raises ValueError in one line."""
    judged = config["judged"]
    paths = photos_of(config["path"])
    first = next(iter(paths.values()))
    photo_size = size_of(first, False)
    if judged["cameras"]:
        cameras = lenses.read(judged["cameras"], photo_size)
    else:
        cameras = lenses.assumed(sorted(paths), size_of(first, True))
    names = [name for name in paths if name in cameras.lenses]
    if not names:
        raise ValueError(
            f"{judged['cameras']}: its cameras "
            f"({faults.some_names(sorted(cameras.lenses))}) are of other photos than "
            f"those of {config['path']} ({faults.some_names(sorted(paths))})"
        )
    found = renders.find(judged["renders"], names, cameras.splits)
    without = sorted(set(paths) - set(found.renders))
    if without:
        log.warning(
            "%d of %d photos have no render, or no camera: %s",
            *(len(without), len(paths), faults.some_names(without)),
        )
    size, odd = one_size(found.renders)
    pairs = [
        pair_of(name, paths[name], found.renders[name], cameras.lenses[name], size)
        for name in sorted(found.renders)
        if name not in odd
    ]
    told = {
        "layout": found.layout,
        "cameras": cameras.kind,
        "without_render": without,
        "of_other_size": sorted(odd),
    }
    return Judged(pairs, size, cameras, told)


def photos_of(folder):
    """{view: path} of the photos in a folder, or in one of OF_PHOTOS inside."""
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"{folder}: no folder of photos")
    for inner in OF_PHOTOS:
        place = folder / inner
        if place.is_dir() and any(
            path.suffix.lower() in photos.SUFFIXES for path in place.iterdir()
        ):
            return {path.stem: path for path in photos.find_images(place)}
    raise ValueError(f"{folder}: no photos ({', '.join(sorted(photos.SUFFIXES))})")


def size_of(path, upright):
    """(width, height) of a photo as stored, or upright."""
    head = photos.head(path)
    if upright and head.orientation in photos.SIDEWAYS:
        return head.size[::-1]
    return head.size


def one_size(found):
    """(the renders' usual size, names of those of another), sheets counted by half."""
    sizes = {}
    for name, render in found.items():
        width, height = photos.head(render.path).size
        sizes[name] = (width // 2 if render.is_sheet else width, height)
    every = list(sizes.values())
    usual = max(set(every), key=lambda size: (every.count(size), size))
    if min(usual) < prepare.MIN_SIZE_PX:
        path = next(iter(found.values())).path
        raise ValueError(f"{path}: renders under {prepare.MIN_SIZE_PX} px a side")
    odd = {name for name, size in sizes.items() if size != usual}
    if odd:
        log.warning(
            "renders of another size than %dx%d are left out: %s",
            *(*usual, faults.some_names(sorted(odd))),
        )
    return usual, odd


def pair_of(name, path, render, lens, size) -> Pair:
    """A view; rows of its photo as stored, or upright where only that fits the render.

    EXIF's orientation is applied by some programs and not by others.
    """
    upright, own = False, size_of(path, False)
    turned = size_of(path, True)
    if turned != own and has_shape(turned, size) and not has_shape(own, size):
        upright, own = True, turned
    camtopix, coefficients = lens.at(own, f"{path}")
    return Pair(name, path, upright, render, (camtopix, coefficients), own, lens.pose)


def has_shape(size, other):
    """Whether two sizes have one shape, but for rounding."""
    across = size[0] / other[0], size[1] / other[1]
    return 1 / prepare.SAME_SHAPE < across[0] / across[1] < prepare.SAME_SHAPE


def read_photo(path, upright, background):
    return photos.decode(path, background, upright=upright)[0]


def read_render(render: renders.Render, background="black"):
    """(the render [h, w, 3], where it counts [h, w]): not where it has nothing.

    Left out are transparent pixels and a black border.
    """
    image = photos.as_stored(render.path, background)
    if render.is_sheet:
        image = image[:, image.shape[1] // 2 :]
    return np.ascontiguousarray(image), ~border(image)


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
    alike = []

    def samples():
        for pair in judged.pairs[::step][:SAMPLES]:
            photo = read_photo(pair.photo, pair.upright, background)
            render, found = read_render(pair.render)[0], ways_of(pair, judged.size)
            alike.append(geometry.likeness(found[0].picture(photo), render))
            yield photo, render, found

    way, apart = geometry.choose(samples())
    if np.median(alike) < geometry.ALIKE:
        log.warning(
            "photos and renders hardly look alike. Are they of the same photos, in the "
            "same order?"
        )
    return way, apart


def shown_of(pair: Pair, size, way):
    """The `geometry.Shown` of a pair; of lenses without that way, the first."""
    found = ways_of(pair, size)
    return next((shown for shown in found if shown.way == way), found[0])


def load(config, scratch):
    """Reader of source `judged`: (views at the renders' size, report, no truth)."""
    judged = find(config)
    way, apart = chosen_way(judged, config["background"])
    log.info("%d pairs, renders %s", len(judged.pairs), judged.told["layout"])
    log.info("renders show photos %s", geometry.WAYS[way])
    shown = {pair.name: shown_of(pair, judged.size, way) for pair in judged.pairs}
    views = posed(judged, shown, config["background"])
    told = judged.told | {"way": way, "apart_px": apart}
    told |= of_depth(config, judged, views)
    (scratch / "pairs.json").write_text(json.dumps(pairs_json(judged, shown, told)))
    report = {
        "registered": len(judged.pairs),
        "total": len(judged.pairs) + len(judged.told["without_render"]),
        "left_out": judged.told["without_render"],
        "mean_reprojection_error_px": None,
        "points": None if views.points is None else len(views.points[0]),
        "models": None,
        "judged": told,
    }
    sizes = [pair.photo_size for pair in judged.pairs]
    report["photo_size"] = list(max(set(sizes), key=sizes.count))
    return views, report, None


def posed(judged: Judged, shown, background) -> prepare.PosedViews:
    """The views: photos as the renders show them, where both have pixels."""
    pairs = judged.pairs
    splits = splits_of(judged)
    return prepare.PosedViews(
        names=[pair.name for pair in pairs],
        pixtocams=np.stack([geometry.pixtocam(shown[pair.name]) for pair in pairs]),
        camtoworlds=np.stack([pair.pose for pair in pairs]),
        width=judged.size[0],
        height=judged.size[1],
        photos=[photo_step(pair, shown[pair.name], background) for pair in pairs],
        masks=[
            prepare.Photo(
                pair,
                (functools.partial(mask_of, shown=shown[pair.name]),),
                pair.render.path,
            )
            for pair in pairs
        ],
        points=judged.cameras.points,
        split=np.array([splits[pair.name] for pair in pairs]),
    )


def at_full_size(config):
    """(the views as large as their photos allow, []): for exports.

    The way is the one that `load` has found, by the same pairs.
    """
    judged = find(config)
    way, _ = chosen_way(judged, config["background"])
    shown = {
        pair.name: geometry.at_photos_size(shown_of(pair, judged.size, way))
        for pair in judged.pairs
    }
    sizes = [one.size for one in shown.values()]
    usual = max(set(sizes), key=sizes.count)
    large = judged._replace(size=usual)
    kept = {name: one for name, one in shown.items() if one.size == usual}
    large = large._replace(pairs=[p for p in judged.pairs if p.name in kept])
    views = posed(large, kept, config["background"])
    return views._replace(masks=None), []


def photo_step(pair: Pair, shown, background):
    """A photo that becomes the picture of its render when it is read."""
    read = functools.partial(read_photo, upright=pair.upright, background=background)
    return prepare.Photo(pair.photo, (read, shown.picture))


def splits_of(judged: Judged):
    """{view: split}: as the renders' folders say, else the cameras, else `train`."""
    found = {}
    for pair in judged.pairs:
        own = pair.render.split or (judged.cameras.splits or {}).get(pair.name)
        found[pair.name] = own or "train"
    return found


def mask_of(pair: Pair, shown):
    """255 where photo and render of a pair both have a pixel [h, w, 3]."""
    _, counts = read_render(pair.render)
    counts = shown.render(
        np.where(counts[..., None], 255, 0).astype(np.uint8).repeat(3, -1)
    )
    counts = (counts >= prepare.WHITE).all(axis=-1) & shown.inside()
    return np.where(counts[..., None], np.uint8(255), np.uint8(0)).repeat(3, axis=-1)


def of_depth(config, judged: Judged, views):
    """What is told of depth: where it comes from, its kind and unit, and the files."""
    points = None if views.points is None else views.points[0]
    if folder := config["judged"]["depth"]:
        paths = depths.find(folder, views.names)
        cameras = zip(views.pixtocams, views.camtoworlds, strict=True)
        size = views.width, views.height
        by_name = {
            name: (*one, size) for name, one in zip(views.names, cameras, strict=True)
        }
        unit = depths.unit_of(paths, by_name, points)
        if config["judged"]["depth_kind"]:
            unit = unit._replace(kind=config["judged"]["depth_kind"])
        if config["judged"]["depth_scale"]:
            unit = unit._replace(scale=config["judged"]["depth_scale"])
        return {
            "depth": "given",
            "depth_kind": unit.kind,
            "depth_scale": unit.scale,
            "depth_spread": None if np.isnan(unit.spread) else unit.spread,
            "depths": {name: str(path) for name, path in paths.items()},
        }
    if judged.cameras.kind == "none" or points is None:
        return {"depth": "far"}
    return {"depth": "points"}


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
    keys = ("depth", "depth_kind", "depth_scale")
    return {"views": of_views} | {key: told.get(key) for key in keys}


def read_pairs(scene):
    """The contents of images/pairs.json of a prepared scene; None without one."""
    path = Path(scene) / PAIRS
    if not path.is_file():
        return None
    return json_files.read(path, {"views": dict, "depth": str})
