"""Photos, masks and cameras of an export, one photo in memory at a time."""

import numpy as np
from PIL import Image

from alignerf.exports import formats
from alignerf.files import images, progress
from alignerf.scenes import prepare

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


def write(folder, views: prepare.PosedViews, *, alpha):
    """Write images/ and, where not all pixels count, masks/; returns whether it did.

    One photo is in memory at a time. alpha: photos get one, of one, as readers of
    NeRF's synthetic scenes need it.
    """
    (folder / "images").mkdir()
    for name, photo in progress.over(
        list(zip(views.names, views.photos, strict=True)), "photos"
    ):
        path, image = folder / "images" / f"{name}.png", photo.read()
        if alpha:
            Image.fromarray(image).convert("RGBA").save(path)
        else:
            images.write(path, image)
    if views.masks is None:
        return False
    (folder / "masks").mkdir()
    for name, mask in zip(views.names, views.masks, strict=True):
        counts = (mask.read() >= prepare.WHITE).all(axis=-1)
        images.write_mask(folder / formats.MASK.format(view=name), counts)
    return True
