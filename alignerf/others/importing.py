"""Renders and depth of another program, checked and written as our own are.

Notation: images [h, w, 3] uint8; depth [h, w] along the optical axis. Infinite depth is
far away: of a camera before it only a turn and a zoom can be seen.
"""

import contextlib
import hashlib
import logging
from pathlib import Path

import cv2
import numpy as np

from alignerf.files import archives, atomic, faults, images, progress, split_paths
from alignerf.scenes import cameras, photos, prepared

log = logging.getLogger("alignerf")

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp")
DEPTH_SUFFIXES = (".npz", ".npy")
# Sizes that differ by rounding: by so many pixels, or by so much of a side.
ROUNDING_PX, ROUNDING_SHARE = 2, 0.02


def take(renders, depth, loaded: prepared.Scene, splits, out_renders, out_depth):
    """Write <view>.png and <view>.npz of the views of some splits; returns how many.

    renders: folder of the other program's images, named like the views. depth: folder
    of its depth maps in the units of the scene's own cameras, or None; without any all
    is far away. loaded: with the cameras that the renders are seen by. out_renders,
    out_depth: paths with `{split}` in them. Raises ValueError where views are missing,
    of another size, empty, broken or twice the same.
    """
    split_paths.check(splits, (out_renders, out_depth))
    names = [loaded.names[view] for split in splits for view in loaded.views(split)]
    found = complete(find(renders, names, SUFFIXES), names, renders)
    depths = find(depth, names, DEPTH_SUFFIXES) if depth else {}
    if depths:
        complete(depths, names, depth)
    else:
        log.info("no depth came with the renders: all counts as far away")
    own = prepared.read_cameras(loaded.folder / "cameras.npz")
    scale = cameras.frame_of(own["camtoworlds"]).scale
    seen, resized = {}, []
    with contextlib.ExitStack() as stack:
        for split in splits:
            folders = [
                stack.enter_context(
                    atomic.replace_folder(split_paths.fill(path, split))
                )
                for path in (out_renders, out_depth)
            ]
            for view in progress.over(list(loaded.views(split)), f"renders {split}"):
                name = loaded.names[view]
                image = fitting(read(found[name]), found[name], loaded, resized)
                check_new(image, found[name], camera_of(loaded, view), seen)
                images.write(folders[0] / f"{name}.png", image)
                depth_map = depth_of(depths.get(name), loaded, scale)
                np.savez(folders[1] / f"{name}.npz", depth=depth_map)
    if resized:
        size = f"{loaded.width}x{loaded.height}"
        some = faults.some_names([path.name for path in resized])
        log.warning("made %s like the photos: %s", size, some)
    return len(names)


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


def fitting(image, path, loaded: prepared.Scene, resized):
    """The image at the scene's size; one that only rounding made another is resized.

    Its path is then added to `resized`. Raises ValueError for any other size.
    """
    size = loaded.width, loaded.height
    own = image.shape[1], image.shape[0]
    if own == size:
        return image
    if not nearly(own, size):
        sizes = f"{own[0]}x{own[1]} pixels, not {size[0]}x{size[1]}"
        raise ValueError(f"{path}: {sizes} as the photos in {{data}}")
    resized.append(path)
    return cv2.resize(image, size, interpolation=cv2.INTER_AREA)


def nearly(size, wanted):
    """Whether only rounding makes a size another one."""
    return all(
        abs(a - b) <= max(ROUNDING_PX, ROUNDING_SHARE * b)
        for a, b in zip(size, wanted, strict=True)
    )


def camera_of(loaded: prepared.Scene, view):
    """A view's camera, to be compared with others'."""
    arrays = loaded.pixtocams[view], loaded.camtoworlds[view]
    return b"".join(array.tobytes() for array in arrays)


def check_new(image, path, camera, seen):
    """ValueError where another camera's image in `seen` is the same; added to it."""
    digest = hashlib.sha256(image.tobytes()).digest()
    other, its_camera = seen.setdefault(digest, (path, camera))
    if camera != its_camera:
        raise ValueError(f"{path}: the same image as {other}, of another camera")


def depth_of(path, loaded: prepared.Scene, scale) -> np.ndarray:
    """Depth [h, w] float32 of a file, in units of the normalised scene.

    Without a file, and where it says nothing (0, NaN), all is far away. scale:
    normalised units of length in one of the file's.
    """
    size = loaded.height, loaded.width
    if path is None:
        return np.full(size, np.inf, np.float32)
    found = archives.read_numbers(path)
    if found.ndim == 3 and found.shape[-1] == 1:
        found = found[..., 0]
    if found.ndim != 2:
        raise ValueError(f"{path}: {found.dtype} {list(found.shape)} is no depth map")
    if found.shape != size:
        if not nearly(found.shape, size):
            raise ValueError(f"{path}: {list(found.shape)} pixels, not {list(size)}")
        found = cv2.resize(
            found.astype(np.float32), size[::-1], interpolation=cv2.INTER_NEAREST
        )
    depth = (scale * found).astype(np.float32)
    return np.where(depth > 0, depth, np.float32(np.inf))
