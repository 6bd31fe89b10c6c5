"""Photos, renders and cameras of another program: source `external_renders`.

Each photo becomes the picture that its render shows, at the render's size (see
`geometry`). What the importer of renders has to know lies in images/pairs.json.
"""

import functools
import json
import logging
import os
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from alignerf.colmap import loading
from alignerf.io import faults, images, json_files
from alignerf.judged import camera_files, depths, geometry, layouts, renders
from alignerf.judged import splat as splats
from alignerf.readers import colmap_models, shots
from alignerf.scenes import held_out, photo_names, photos, prepare, prepared

log = logging.getLogger("alignerf")

# Below the prepared scene's folder.
PAIRS = "images/pairs.json"
# Pairs by which the geometry is chosen.
SAMPLES = 6
# A render's black border is one from this share of its pixels on.
BORDER_FRACTION = 0.001
# Where the photos lie in a folder.
OF_PHOTOS = (".", *colmap_models.OF_PHOTOS)


class Pair(NamedTuple):
    """A view: its photo's path, its render, its lens at the photo's size."""

    name: str
    photo: Path
    upright: bool
    render: layouts.Render
    lens: tuple
    photo_size: tuple
    pose: np.ndarray


class ExternalRenders(NamedTuple):
    """All pairs of a project, one size of renders, and what is told of it."""

    pairs: list
    size: tuple
    cameras: shots.Cameras
    told: dict


def find(config) -> ExternalRenders:
    """The pairs of a scene's keys. Raises ValueError in one line."""
    judged, every = config.external_renders, config.test_every
    cameras = taken(config.path, judged.cameras, judged.renders)
    of_views = {shot.name: shot for shot in cameras.shots}
    paths = {name: shot.photo for name, shot in of_views.items()}
    found = renders.find(judged.renders, paths, cameras.splits, every)
    if every:
        splits = layouts.every_nth(layouts.in_order(paths), every)
        each = found.renders.items()
        each = {n: one._replace(split=splits[n]) for n, one in each}
        found = found._replace(renders=each)
    without = sorted(set(paths) - set(found.renders))
    if without:
        log.warning(
            "%d of %d photos have no render: %s",
            *(len(without), len(paths), faults.some_names(without)),
        )
    size, odd = one_size(found.renders)
    pairs = [
        pair_of(of_views[name], found.renders[name], size, cameras.kind)
        for name in sorted(found.renders)
        if name not in odd
    ]
    for pair in pairs:
        if not pair.render.sheet and os.path.samefile(pair.photo, pair.render.path):
            raise ValueError(f"{pair.render.path}: this render is the photo itself")
    told = {
        "layout": found.layout,
        "held_out": held_out_by(every, found.renders, cameras),
        "cameras": cameras.kind,
        "without_render": without,
        "of_other_size": sorted(odd),
    }
    return ExternalRenders(pairs, size, cameras, told)


def held_out_by(every, found, cameras):
    """How it is known which views were held out, in words; None where it is not."""
    if every:
        return f"one in {every} by name, as was said"
    if any(one.split for one in found.values()):
        return "by the renders' folders and names"
    return "by the cameras' file" if cameras.splits else None


def taken(folder, file=None, apart=None):
    """`shots.Cameras` with the photos of a folder, by the names of their views.

    file: of the cameras, or their folder; None where nothing is known of them. apart: a
    folder whose images are no photos, unless there are no others. Photos without a
    camera are left out with a warning, and so are cameras without a photo. Raises
    ValueError where none has one.
    """
    place, paths = photos_of(folder)
    if apart:
        others = [p for p in paths if not (place / p).is_relative_to(apart)]
        paths = others or paths
    if not file:
        # Of a photo that is linked twice both would have the same pose.
        once = {held_out.identity(place / path): path for path in reversed(paths)}
        paths = sorted(once.values())
    own = camera_files.read(file) if file else camera_files.assumed(paths)
    return shots.placed(own, [place], among=paths, partial=True)


def photos_of(folder):
    """(the place of photos, their paths in it): a folder, or one of OF_PHOTOS inside.

    Photos in folders of a place count where none lies in one of these at once.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"{folder}: no folder of photos")
    below = {}
    for place in filter(Path.is_dir, (folder / inner for inner in OF_PHOTOS)):
        below[place] = photo_names.listed(place)
        if at_once := [path for path in below[place] if "/" not in path]:
            return place, at_once
    for place in [*list(below)[1:], folder]:
        if below[place]:
            return place, below[place]
    raise ValueError(f"{folder}: no photos ({', '.join(sorted(photos.SUFFIXES))})")


def one_size(found):
    """(the renders' usual size, names of those of another), sheets counted by half."""
    sizes = {name: render.size for name, render in found.items()}
    usual = prepare.usual_size(list(sizes.values()))
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


def pair_of(shot, render, size, kind) -> Pair:
    """A view; rows of its photo as stored, or upright where only that fits the render.

    EXIF's orientation is applied by some programs and not by others.
    """
    upright = shot.head.lies_as(size)
    own = shot.head.size[::-1] if upright else shot.head.size
    is_guess = kind == camera_files.NONE
    lens = camera_files.guessed(own) if is_guess else shot.at(own, shot.photo)
    return Pair(shot.name, shot.photo, upright, render, lens, own, shot.pose)


def files_of(judged: ExternalRenders, keys):
    """Paths of all that pairs are read from; keys: those of `external_renders`."""
    found = [path for pair in judged.pairs for path in (pair.photo, pair.render.path)]
    found += camera_files.files_of(keys.cameras)
    if depth := keys.depth:
        found += depths.find(depth, [pair.name for pair in judged.pairs]).values()
    return found


def splits_of(judged: ExternalRenders):
    """{view: split}: as the renders' folders say, else the cameras, else `train`."""
    found = {}
    for pair in judged.pairs:
        own = pair.render.split or (judged.cameras.splits or {}).get(pair.name)
        found[pair.name] = own or "train"
    return found


def read_render(render: layouts.Render, background=None):
    """(the render [h, w, 3], where it counts [h, w]): not where it has nothing.

    Left out are a black border and, where no background is given, what is transparent.
    """
    image = photos.as_stored(render.path, background or "black")
    counts = ~border(image)
    if background is None and photos.may_be_transparent(render.path):
        # What lies behind shows through.
        counts &= (image == photos.as_stored(render.path, "white")).all(axis=-1)
    image, counts = map(render.half, (image, counts))
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
    return found if found.mean() > BORDER_FRACTION else np.zeros_like(found)


def read_photo(path, upright, background):
    return photos.decode(path, background, upright=upright)[0]


def shown_of(judged: ExternalRenders, background):
    """({view: `geometry.Shown`} by the way that fits, that way, {way: px}).

    The way is chosen by some of the pairs; of a lens without it the first is taken.
    """
    step = max(len(judged.pairs) // SAMPLES, 1)
    found = {
        pair.name: geometry.ways(
            pair.lens, pair.photo_size, judged.size, pair.render.path
        )
        for pair in judged.pairs
    }
    way, apart_px = geometry.choose(
        (
            read_photo(pair.photo, pair.upright, background),
            read_render(pair.render, background)[0],
            found[pair.name],
        )
        for pair in judged.pairs[::step][:SAMPLES]
    )
    shown = {
        name: next((one for one in ways if one.way == way), ways[0])
        for name, ways in found.items()
    }
    return shown, way, apart_px


def load(config, scratch):
    """Its reader: (views at the renders' size, report, no truth)."""
    judged = find(config)
    shown, way, apart_px = shown_of(judged, config.background)
    log.info("%d pairs, renders %s", len(judged.pairs), judged.told["layout"])
    log.info("renders show photos %s", geometry.WAYS[way])
    views = posed(judged, shown, config.background)
    keys = config.external_renders
    prepared.check_views(keys.cameras or config.path, views)
    told = judged.told | {"way": way, "apart_px": apart_px}
    told |= {"background": config.background}
    renders_of = [pair.render.path for pair in judged.pairs]
    told["transparent"] = any(map(photos.may_be_transparent, renders_of))
    own = Path(keys.renders).with_name(splats.TOLD)
    known_px = splats.trained_px(Path(keys.renders, splats.TOLD), judged.cameras)
    if told.setdefault("of_splat", own.is_file()):
        known_px = json_files.read(own).get("trained_px")
    # Renders that are larger lack detail.
    told["trained_px"] = known_px if (known_px or 0) > 0.99 * max(judged.size) else None
    told |= of_depth(config, judged, views)
    beside = scratch / prepared.BESIDE
    beside.mkdir()
    (beside / "pairs.json").write_text(json.dumps(pairs_json(judged, shown, told)))
    sizes = [pair.photo_size for pair in judged.pairs]
    report = loading.registration(views.names, judged.told["without_render"]) | {
        "points": None if views.points is None else len(views.points[0]),
        "external_renders": told,
        "files": files_of(judged, keys),
        "photo_size": list(max(set(sizes), key=sizes.count)),
    }
    return views, report, None


def posed(judged: ExternalRenders, shown, background) -> prepare.PosedViews:
    """The views: photos as the renders show them, where both have pixels."""
    own, splits = judged.pairs, splits_of(judged)
    photos_of_views, masks = [], []
    for pair in own:
        one = shown[pair.name]
        read = functools.partial(
            read_photo, upright=pair.upright, background=background
        )
        photos_of_views.append(prepare.Photo(pair.photo, (read, one.picture)))
        mask = functools.partial(mask_of, shown=one, background=background)
        masks.append(prepare.Photo(pair, (mask,), pair.render.path))
    return prepare.PosedViews(
        names=[pair.name for pair in own],
        pixtocams=np.stack([np.linalg.inv(shown[pair.name].camtopix) for pair in own]),
        camtoworlds=np.stack([pair.pose for pair in own]),
        width=judged.size[0],
        height=judged.size[1],
        photos=photos_of_views,
        masks=masks,
        points=judged.cameras.points,
        split=np.array([splits[pair.name] for pair in own]),
    )


def at_full_size(config):
    """(the views as large as most photos allow, []): for exports.

    The way is the one that `load` has found, by the same pairs.
    """
    judged = find(config)
    shown, *_ = shown_of(judged, config.background)
    sizes = list(map(geometry.photos_size, shown.values()))
    size = prepare.usual_size(sizes)
    large = {name: geometry.at_size(one, size) for name, one in shown.items()}
    views = posed(judged._replace(size=size), large, config.background)
    masks = None
    if not all(one.inside().all() for one in shown.values()):
        # Beyond the photo its border is repeated, which is nothing to learn from.
        masks = [prepare.Photo(large[name], (inside_of,)) for name in views.names]
    return views._replace(masks=masks), []


def inside_of(shown):
    """An image of the mask [h, w, 3] of what a photo shows of its picture."""
    return images.of_mask(shown.inside())


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


def pairs_json(judged: ExternalRenders, shown, told):
    """What the importer of the renders reads: `read_pairs`."""
    of_views = {}
    for pair in judged.pairs:
        lens = shown[pair.name].render_lens
        of_views[pair.name] = {
            "render": str(pair.render.path),
            "sheet": pair.render.sheet,
            "lens": lens and [lens[0].tolist(), lens[1].tolist()],
            "depth": told.get("depths", {}).get(pair.name),
        }
    told.pop("depths", None)
    keys = ("depth", "background")
    return {"views": of_views} | {key: told.get(key) for key in keys}


def read_pairs(scene):
    """The contents of images/pairs.json of a prepared scene; None without one."""
    path = Path(scene) / PAIRS
    if not path.is_file():
        return None
    return json_files.read(path, {"views": dict, "depth": str})


def of_depth(config, judged: ExternalRenders, views):
    """What is told of depth: where it comes from, and the files."""
    if folder := config.external_renders.depth:
        paths = depths.find(folder, views.names)
        if missing := [name for name in views.names if name not in paths]:
            log.warning(
                "%d of %d views have no depth, and all that they see counts as far "
                "away: %s",
                *(len(missing), len(views.names), faults.some_names(missing)),
            )
        paths = {name: str(path) for name, path in paths.items()}
        return {"depth": "given", "depths": paths}
    if judged.cameras.kind == camera_files.NONE or views.points is None:
        return {"depth": "far"}
    return {"depth": "points"}
