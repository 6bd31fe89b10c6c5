"""Images and depth of another program, checked: each a function of a view.

Notation: images [h, w, 3] uint8; depth [h, w] along the optical axis, in units of the
normalised scene. Infinite depth is far away: of a camera before it only a turn and a
zoom can be seen.
"""

import hashlib
import logging
from pathlib import Path

import cv2
import numpy as np

from alignerf.files import archives, faults
from alignerf.scenes import cameras, distortion, photos, prepared
from alignerf.scenes.judged import depths, renders, views

log = logging.getLogger("alignerf")

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp")
DEPTH_SUFFIXES = (".npz", ".npy")
# Sizes that differ by rounding: by so many pixels, or by so much of a side.
ROUNDING_PX, ROUNDING_SHARE = 2, 0.02


def of_folders(images, depth, loaded: prepared.Scene, splits):
    """View -> (image, depth) of files that are named like the views of some splits.

    images, depth: folders, the latter in the units of the scene's own cameras, or None;
    without any all is far away. loaded: with the cameras that the renders are seen by.
    Raises ValueError where views are missing, of another size, empty, broken or twice
    the same.
    """
    names = [loaded.names[view] for split in splits for view in loaded.views(split)]
    found = complete(find(images, names, SUFFIXES), names, images)
    maps = find(depth, names, DEPTH_SUFFIXES) if depth else {}
    if maps:
        complete(maps, names, depth)
    else:
        log.info("no depth came with the renders: all counts as far away")
    scale, seen = scale_of(loaded), {}

    def of_view(view):
        name = loaded.names[view]
        image = fitting(read(found[name]), found[name], loaded)
        digest = hashlib.sha256(image.tobytes()).digest()
        camera = loaded.pixtocams[view].tobytes() + loaded.camtoworlds[view].tobytes()
        other, its_camera = seen.setdefault(digest, (found[name], camera))
        if camera != its_camera:
            fault = f"the same image as {other}, of another camera"
            raise ValueError(f"{found[name]}: {fault}")
        return image, scale * depth_of(maps.get(name), loaded)

    return of_view


def of_pairs(loaded: prepared.Scene):
    """View -> (image, depth) of a scene that is judged."""
    if (pairs := views.read_pairs(loaded.folder)) is None:
        raise ValueError(f"{loaded.folder / views.PAIRS}: not found")
    own, points = prepared.read_cameras(loaded.folder / "cameras.npz"), None
    scale = scale_of(loaded)
    if pairs["depth"] == "points":
        path = loaded.folder / prepared.POINTS
        points = archives.read(path, ("points",))["points"]

    def of_view(view):
        pair = pairs["views"][loaded.names[view]]
        render = renders.Render(Path(pair["render"]), pair["is_sheet"])
        image, _ = views.read_render(render, pairs.get("background"))
        # Of a render that shows the distortion: (camtopix, distortion).
        lens = pair["lens"] and tuple(map(np.array, pair["lens"]))
        if lens:
            camtopix = np.linalg.inv(loaded.pixtocams[view])
            image = distortion.undistort(image, *lens, camtopix)
        return image, scale * depth_of_pair(pairs, pair, own, view, points, lens)

    return of_view


def depth_of_pair(pairs, pair, own, view, points, lens):
    """Depth [h, w] along the optical axis, in the unit of the cameras as given."""
    size, pixtocam = (int(own["width"]), int(own["height"])), own["pixtocams"][view]
    if points is not None:
        return depths.of_points(points, pixtocam, own["camtoworlds"][view], size)
    if pairs["depth"] == "given" and pair["depth"]:
        values = depths.read(pair["depth"])
        values = depths.as_shown(values, pixtocam, size, lens)
        along = depths.along_axis(values, pairs["depth_kind"], pixtocam)
        return pairs["depth_scale"] * along
    return np.full(size[::-1], np.inf, np.float32)


def scale_of(loaded):
    """Normalised units of length in one of the cameras as given."""
    own = prepared.read_cameras(loaded.folder / "cameras.npz")
    return cameras.frame_of(own["camtoworlds"]).scale


def find(folder, names, suffixes):
    """{view: path} of the files below a folder that are named like views.

    Raises ValueError where two files have the name of one view, or no folder is there.
    """
    folder, wanted, found = Path(folder), set(names), {}
    if not folder.is_dir():
        raise ValueError(f"{folder}: no such folder")
    for path in sorted(folder.rglob("*")):
        name = path.name[: -len(path.suffix)] if path.suffix else path.name
        if path.suffix.lower() not in suffixes or name not in wanted:
            continue
        if name in found:
            raise ValueError(f"{path}: view {name} is there twice, see {found[name]}")
        found[name] = path
    return found


def complete(found, names, folder):
    """The same, or ValueError with some names of views that are missing."""
    if missing := [name for name in names if name not in found]:
        some = faults.some_names(missing)
        others = sorted(p.name for p in Path(folder).rglob("*") if p.is_file())
        has = f"; it has {faults.some_names(others)}" if others else "; it is empty"
        raise ValueError(
            f"{folder}: {len(missing)} of {len(names)} views are missing: {some}{has}"
        )
    return found


def read(path) -> np.ndarray:
    """The image of a file; ValueError where it is broken or shows nothing."""
    # As photos are read, 16 bits and alpha too.
    pixels = photos.as_stored(path, "black")
    if (pixels == pixels[:1, :1]).all():
        raise ValueError(f"{path}: an empty image, all of one colour")
    return pixels


def fitting(image, path, loaded: prepared.Scene):
    """The image at the scene's size; one that only rounding made another is resized.

    Raises ValueError for any other size.
    """
    size, own = (loaded.width, loaded.height), image.shape[1::-1]
    if own == size:
        return image
    if not nearly(own, size):
        sizes = f"{own[0]}x{own[1]} pixels, not {size[0]}x{size[1]}"
        raise ValueError(f"{path}: {sizes} as the photos in {{data}}")
    log.warning("made %dx%d like the photos: %s", *size, path.name)
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def nearly(size, wanted):
    """Whether only rounding makes a size another one."""
    return all(
        abs(a - b) <= max(ROUNDING_PX, ROUNDING_SHARE * b)
        for a, b in zip(size, wanted, strict=True)
    )


def depth_of(path, loaded: prepared.Scene) -> np.ndarray:
    """Depth [h, w] of a file, in its units; without one all is far away."""
    size = loaded.height, loaded.width
    if path is None:
        return np.full(size, np.inf, np.float32)
    found = archives.read_numbers(path)
    if found.ndim == 3 and found.shape[-1] == 1:
        found = found[..., 0]
    if found.ndim != 2:
        raise ValueError(f"{path}: {found.dtype} {list(found.shape)} is no depth map")
    if found.shape == size:
        return found
    if not nearly(found.shape, size):
        raise ValueError(f"{path}: {list(found.shape)} pixels, not {list(size)}")
    return cv2.resize(
        found.astype(np.float32), size[::-1], interpolation=cv2.INTER_NEAREST
    )
