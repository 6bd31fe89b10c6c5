"""NeRF's synthetic scenes: transforms_train.json, _val and _test beside one another.

The files say which views are trained on and which are scored; those of `val`, which no
published score uses, are left out. Photos have alpha: they stand on a background.
"""

from pathlib import Path

import numpy as np

from alignerf.command import faults
from alignerf.scenes import prepare, transforms

SPLITS = ("train", "test")


def read(folder, background):
    """Posed views with their split, and the names of training frames without a photo.

    A view's name begins with its split. background: as of `photos.decode`. Raises
    ValueError with one line that names the file and the key or frame.
    """
    parts, names, splits, left_out = [], [], [], []
    for split in SPLITS:
        path = Path(folder) / f"transforms_{split}.json"
        views, missing = transforms.read(path, background)
        if missing and split == "test":
            few = faults.some_names(missing)
            raise ValueError(
                f"{path}: no image of {few}: the score would be another one"
            )
        left_out += [named(split, name) for name in missing]
        parts.append(views)
        names += [named(split, name) for name in views.names]
        splits += [split] * len(views.names)
    sizes = {(views.width, views.height) for views in parts}
    if len(sizes) > 1:
        raise ValueError(f"{folder}: photos of train and test differ in size")
    first, second = parts
    count = len(first.names)
    views = prepare.PosedViews(
        names=names,
        pixtocams=np.concatenate([views.pixtocams for views in parts]),
        camtoworlds=np.concatenate([views.camtoworlds for views in parts]),
        width=first.width,
        height=first.height,
        load=lambda i: first.load(i) if i < count else second.load(i - count),
        split=np.array(splits),
    )
    return views, left_out


def named(split, name):
    """A view's name, which begins with its split; exported ones have it already."""
    return name if name.startswith(f"{split}_") else f"{split}_{name}"
