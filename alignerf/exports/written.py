"""Photos, masks and cameras of an export, at their own size or as trained on.

Photos and masks are read a few at a time, when they are written.
"""

import functools
import json
import logging
from pathlib import Path

import numpy as np
from PIL import Image

from alignerf.colmap import loading
from alignerf.exports import formats
from alignerf.io import faults, images, yaml_files
from alignerf.scenes import prepare, prepared

log = logging.getLogger("alignerf")

# Of their own size: cameras that went into the scene's frame and back differ by less.
SAME = 1e-6


def has_moved(given, now, views=slice(None)):
    """Whether cameras are others than those given; of these views, or of all."""
    far = SAME * np.abs(given["camtoworlds"]).max()
    return not all(
        np.allclose(given[key][views], now[key][views], rtol=SAME, atol=atol)
        for key, atol in (("camtoworlds", far), ("pixtocams", 1e-12))
    )


def arrays_of(views: prepare.PosedViews):
    """The arrays of a cameras.npz of the views."""
    names, split = np.array(views.names), np.array(views.split)
    arrays = {key: getattr(views, key) for key in ("pixtocams", "camtoworlds")}
    return arrays | {
        "names": names,
        "split": split,
        "width": views.width,
        "height": views.height,
    }


def write(folder, views: prepare.PosedViews, *, alpha, hidden=()):
    """Write images/ and, where not all pixels count, masks/; returns whether it did.

    hidden: {view: (width, height) -> [h, w] bool} of what does not count besides.
    alpha: photos get one, of one, as readers of NeRF's synthetic scenes need it.
    """
    (folder / "images").mkdir()

    def write_one(name, image):
        path = folder / "images" / f"{name}.png"
        if alpha:
            Image.fromarray(image).convert("RGBA").save(path)
        else:
            images.write(path, image)

    prepare.each_photo(views, write_one, "photos")
    if views.masks is None and not hidden:
        return False
    (folder / "masks").mkdir()
    size = views.width, views.height
    masks = views.masks or [prepare.all_count(*size)] * len(views.names)
    for name, mask in zip(views.names, masks, strict=True):
        counts = (mask.read() >= prepare.WHITE).all(axis=-1)
        if name in hidden:
            counts &= ~hidden[name](size)
        images.write_mask(folder / formats.MASK.format(view=name), counts)
    return True


def config_of(text, folder):
    """A scene's keys: JSON, else what the config.yaml in its folder says, or None.

    Raises ValueError naming the file where that is of no scene, or of several.
    """
    if text:
        try:
            return json.loads(text)
        except (json.JSONDecodeError, RecursionError) as error:
            raise ValueError(f"--config is not JSON: {error}") from None
    path = Path(folder) / "config.yaml"
    if not path.is_file():
        return None
    content = yaml_files.read(path)
    scenes = content.get("scenes") if isinstance(content, dict) else None
    if isinstance(scenes, dict) and len(scenes) == 1:
        return next(iter(scenes.values()))
    # Beside a scene stand its crops; its folder has its name.
    name = faults.resolved(folder).name
    if not isinstance(scenes, dict) or name not in scenes:
        raise ValueError(f"{path}: not the config of one scene")
    return scenes[name]


def of_photos(config, folder, work_folder, cameras_path) -> prepare.PosedViews:
    """The views at the size of their photos; arguments: as of `loading.read`.

    Raises ValueError where the photos are gone.
    """
    path = config.path
    if path and not Path(path).exists():
        raise ValueError(f"{path}: the photos of {folder} are gone")
    return loading.read(config, folder, work_folder, cameras_path)


def as_trained(loaded: prepared.Scene, cameras_path) -> prepare.PosedViews:
    """The views of a prepared scene with its images as they are, whole or refused."""
    arrays, size = prepared.read_cameras(cameras_path), (loaded.width, loaded.height)
    read = functools.partial(images.read, size=size)
    masks = None
    if (loaded.folder / prepared.MASKS).is_dir():
        mask_of = functools.partial(read_mask, loaded)
        masks = [prepare.Photo(i, (mask_of,)) for i in range(len(loaded.names))]
    return prepare.PosedViews(
        names=loaded.names,
        pixtocams=arrays["pixtocams"],
        camtoworlds=arrays["camtoworlds"],
        width=loaded.width,
        height=loaded.height,
        photos=[
            prepare.Photo(loaded.folder / "images" / f"{name}.png", (read,))
            for name in loaded.names
        ],
        points=loading.points_of(loaded.folder),
        split=arrays["split"],
        masks=masks,
    )


def read_mask(loaded: prepared.Scene, view):
    """An image of a view's mask, as `prepare.PosedViews` has masks."""
    return images.of_mask(prepared.read_masks(loaded, [view])[0])


def at_width(views: prepare.PosedViews, width_px) -> prepare.PosedViews:
    """The views made smaller to a width; None, and what would enlarge, change nothing.

    Raises ValueError for a width that leaves too few pixels.
    """
    if width_px is None or width_px == views.width:
        return views
    if width_px > views.width:
        log.warning(
            "export_width_px: %d: photos of %d px stay as they are, as nothing is "
            "enlarged",
            *(width_px, views.width),
        )
        return views
    factor = views.width / width_px
    if min(prepare.smaller(views, factor)) < prepare.MIN_SIZE_PX:
        raise ValueError(
            f"export_width_px: {width_px} leaves less than {prepare.MIN_SIZE_PX} px of "
            f"photos of {views.width}x{views.height}"
        )
    return prepare.downscale(views, factor)
