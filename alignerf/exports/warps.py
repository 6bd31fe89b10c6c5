"""Photos as a training saw them, warped once more at their own size.

The flow that warped them has the size of training. It is made as large as the photos,
bilinearly, and so is the mask of the pixels for which it holds: a large pixel counts
where all small ones around it do.

Notation: h, w of the training; H, W of the photos; `flow_px` x then y in pixels.
"""

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from alignerf.io import archives, images
from alignerf.scenes import prepare, prepared
from flow.warping import small, warp

# What a file of valid pixels has besides, where it can say how its photo was warped: a
# flow, or offsets of an image made smaller by `shrink` (see alignerf.alignment).
FLOW, OFFSETS = ("flow_px",), ("offsets_px", "shrink")


class Warp(NamedTuple):
    """How a photo is warped: path of <view>.npz, (H, W)."""

    path: Path
    size: tuple[int, int]

    def flow_px(self, size):
        """The flow [h, w, 2] of the training's size (h, w)."""
        if archives.has(self.path, *FLOW):
            flow_px = archives.read(self.path, FLOW)["flow_px"]
        else:
            offsets_px, k = archives.read(self.path, OFFSETS).values()
            flow_px = small.enlarge(offsets_px, int(k), size)
        if flow_px.shape[:2] != size:
            raise ValueError(f"{self.path}: a flow of {flow_px.shape[:2]}, not {size}")
        return flow_px

    def large(self):
        """(flow_px [H, W, 2], valid [H, W])."""
        valid = archives.read(self.path, ["valid"])["valid"]
        flow_px = enlarge(self.flow_px(valid.shape), self.size)
        return flow_px, enlarge_mask(valid, self.size)

    def photo(self, image):
        """The photo [H, W, 3], warped."""
        flow_px, _ = self.large()
        return warp.warp(image, flow_px)

    def mask(self, image):
        """The mask [H, W, 3] of the warped photo; image: the photo's own mask."""
        flow_px, valid = self.large()
        counts = (image >= prepare.WHITE).all(axis=-1)
        valid &= warp.in_frame(flow_px)
        if not counts.all():
            valid &= counts & warp.sees_only(flow_px, counts)
        return images.of_mask(valid)


def enlarge(flow_px, size):
    """The flow [H, W, 2] in pixels of a photo of size (H, W); borders go on."""
    h, w = flow_px.shape[:2]
    scale = np.array([size[1] / w, size[0] / h], np.float32)
    return scale * resized(np.asarray(flow_px, np.float32), size)


def enlarge_mask(mask, size):
    """The mask [H, W] of size (H, W): true where all small pixels around are."""
    return resized(mask.astype(np.float32), size) > 1 - 1e-3


def resized(values, size):
    """Values at the centres of the pixels of another size, bilinearly."""
    if values.shape[:2] == size:
        return values
    return cv2.resize(values, size[::-1], interpolation=cv2.INTER_LINEAR)


def are_known(names, valid):
    """Whether the files of a folder say how each of these views was warped."""
    paths = [Path(valid) / f"{name}.npz" for name in names]
    return all(
        archives.has(path, *FLOW) or all(archives.has(path, key) for key in OFFSETS)
        for path in paths
    )


def at_full_size(views: prepare.PosedViews, valid) -> prepare.PosedViews:
    """The views with the photos and masks of training views warped.

    valid: a folder of <view>.npz for which `are_known` holds.
    """
    size = views.height, views.width
    photos, masks = list(views.photos), list(views.masks or all_masks(views))
    for i in np.flatnonzero(views.split == "train"):
        one = Warp(Path(valid) / f"{views.names[i]}.npz", size)
        photos[i] = photos[i].then(one.photo)
        masks[i] = masks[i].then(one.mask)
    return views._replace(photos=photos, masks=masks)


def as_trained(views: prepare.PosedViews, loaded, warped, valid) -> prepare.PosedViews:
    """The views with the warped photos of a training, and where these hold.

    warped: folder of <view>.png; valid: of <view>.npz.
    """
    photos, masks = list(views.photos), list(views.masks or all_masks(views))

    def read(view):
        return prepared.read_images(loaded, [view], warped)[0]

    def mask_of(view):
        own = prepared.read_masks(loaded, [view])
        return images.of_mask((own & prepared.read_validity(loaded, [view], valid))[0])

    for i in loaded.views("train"):
        photos[i] = prepare.Photo(i, (read,))
        masks[i] = prepare.Photo(i, (mask_of,))
    return views._replace(photos=photos, masks=masks)


def all_masks(views: prepare.PosedViews):
    """A mask of each view in which all pixels count."""
    return [prepare.all_count(views.width, views.height)] * len(views.names)
