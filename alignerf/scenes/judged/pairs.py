"""Which photo, render and camera of another program belong to one view."""

import logging
import os
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.captures import base
from alignerf.files import faults
from alignerf.scenes import photos, prepare
from alignerf.scenes.judged import depths, lenses, renders

log = logging.getLogger("alignerf")

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
    judged = base.section(config, "judged")
    paths = photos_of(config["path"])
    if judged["cameras"]:
        first = next(iter(paths.values()))
        cameras = lenses.read(judged["cameras"], photos.head(first).size)
    else:
        cameras = lenses.assumed(sorted(paths))
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
    for pair in pairs:
        if not pair.render.is_sheet and os.path.samefile(pair.photo, pair.render.path):
            raise ValueError(f"{pair.render.path}: this render is the photo itself")
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


def one_size(found):
    """(the renders' usual size, names of those of another), sheets counted by half."""
    sizes = {}
    for name, render in found.items():
        width, height = photos.head(render.path).size
        if render.is_sheet and width % 2:
            raise ValueError(
                f"{render.path}: {width} px wide: a photo and a render side by side "
                "are of one width"
            )
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
    head = photos.head(path)
    upright, own = False, head.size
    turned = own[::-1] if head.orientation in photos.SIDEWAYS else own
    fits = prepare.has_shape(turned, size) and not prepare.has_shape(own, size)
    if turned != own and fits:
        upright, own = True, turned
    camtopix, coefficients = lens.at(own, f"{path}")
    return Pair(name, path, upright, render, (camtopix, coefficients), own, lens.pose)


def files_of(judged: Judged, keys):
    """Paths of all that pairs are read from; keys: those of `judged`."""
    found = [path for pair in judged.pairs for path in (pair.photo, pair.render.path)]
    found += lenses.files_of(keys.get("cameras"))
    if depth := keys.get("depth"):
        found += depths.find(depth, [pair.name for pair in judged.pairs]).values()
    return found


def splits_of(judged: Judged):
    """{view: split}: as the renders' folders say, else the cameras, else `train`."""
    found = {}
    for pair in judged.pairs:
        own = pair.render.split or (judged.cameras.splits or {}).get(pair.name)
        found[pair.name] = own or "train"
    return found
