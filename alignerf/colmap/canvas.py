"""Photos of several sizes and lenses on one canvas, with one focal length in px.

The canvas has the most common size of the photos. A photo of another size or lens is
scaled to the canvas's focal length, and its principal point is put in the middle of the
canvas. Pixels beyond the canvas are cut off. Canvas pixels without a photo are masked.
"""

import functools

import cv2
import numpy as np

from alignerf.io import images
from alignerf.scenes import cameras, distortion, prepare

# Two estimates of one lens's focal length differ by a smaller share. Photos whose focal
# length differs by less are not scaled, so they lose no sharpness.
SAME_ANGLE = 0.03


def views_of(
    names, lenses, sizes, camtoworlds, *, camera_of, photos, masks=None, where
):
    """PosedViews of photos of any sizes and lenses, distortion undone, on one canvas.

    Of each photo: lenses (camtopix [3, 3], distortion [5]); sizes (width, height);
    camera_of, the camera's number; photos, masks, a `prepare.Photo`. The views come in
    groups of one size and camera, not in the order of `names`. where: named in the
    ValueError of `distortion.pinhole_views`.
    """
    keys = list(zip(sizes, camera_of, strict=True))
    groups = {}
    for key in dict.fromkeys(keys):
        chosen = [i for i, one in enumerate(keys) if one == key]
        groups[key] = distortion.pinhole_views(
            [names[i] for i in chosen],
            [lenses[i] for i in chosen],
            camtoworlds[chosen],
            width=key[0][0],
            height=key[0][1],
            photos=[photos[i] for i in chosen],
            masks=masks and [masks[i] for i in chosen],
            where=where,
        )
    size = prepare.usual_size(sizes)
    usual = max((k for k in groups if k[0] == size), key=keys.count)
    focal_px = focal_of(groups[usual])
    laid = []
    for key, group in groups.items():
        differs = np.abs(focal_of(group) / focal_px - 1).max() > SAME_ANGLE
        laid.append(lay(group, focal_px, size) if key[0] != size or differs else group)
    return laid[0] if len(laid) == 1 else prepare.join(laid, masked=True)


def focal_of(views):
    """Focal length [2] in px along x and y: the median over the views."""
    return np.median(np.linalg.inv(views.pixtocams)[:, [0, 1], [0, 1]], axis=0)


def lay(views: prepare.PosedViews, focal_px, size):
    """Pinhole views, scaled and laid onto the canvas.

    focal_px [2]: the canvas's focal length along x and y. size: the canvas's (width,
    height). A scaled photo's width and height are rounded to whole pixels.
    """
    camtopix = np.linalg.inv(views.pixtocams)
    own = views.width, views.height
    places = [place(one, focal_px, own, size) for one in camtopix]
    pixtocams = [
        moved(
            cameras.rescale_intrinsics(pixtocam, new[0] / own[0], new[1] / own[1]),
            corner,
        )
        for pixtocam, (new, corner) in zip(views.pixtocams, places, strict=True)
    ]
    return views._replace(
        pixtocams=np.stack(pixtocams),
        width=size[0],
        height=size[1],
        photos=[
            photo.then(functools.partial(put, placed=placed, own=own, size=size))
            for photo, placed in zip(views.photos, places, strict=True)
        ],
        masks=masks_of(views, places, size),
    )


def masks_of(views, places, size):
    """The masks of the views on the canvas; canvas pixels without a photo are 0."""
    if views.masks is None:
        laid = functools.partial(inside, size=size)
        return [prepare.Photo(placed, (laid, images.of_mask)) for placed in places]
    own, masks = (views.width, views.height), []
    for mask, placed in zip(views.masks, places, strict=True):
        is_enlarged = placed[0][0] > own[0]
        # An enlarged photo is interpolated: hidden pixels must not come through.
        hidden = mask.then(distortion.eroded) if is_enlarged else mask
        lay_mask = functools.partial(put, placed=placed, own=own, size=size)
        masks.append(hidden.then(lay_mask))
    return masks


def put(image, placed, own, size):
    """An image, scaled and laid onto the canvas; pixels without a photo are black.

    placed: of `place`. own: (width, height) of the photo before scaling. size: (width,
    height) of the canvas.
    """
    (width, height), (left, top) = placed
    if width < own[0]:
        image = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    # Pixel centres lie at +0.5 in photo and canvas. One warp scales and cuts: an
    # enlarged photo may be far larger than the canvas, and is never made whole.
    scale = np.array([width, height]) / image.shape[1::-1]
    move = np.array([left, top]) + 0.5 * scale - 0.5
    matrix = np.concatenate([np.diag(scale), move[:, None]], axis=1)
    canvas = cv2.warpAffine(
        image,
        matrix,
        size,
        flags=cv2.INTER_LANCZOS4 if width > own[0] else cv2.INTER_NEAREST,
        borderMode=cv2.BORDER_REPLICATE,
    )
    canvas[~inside(placed, size)] = 0
    return canvas


def inside(placed, size):
    """Mask [h, w] of the canvas pixels that a photo covers; size: (width, height)."""
    (width, height), (left, top) = placed
    shown = np.zeros(size[::-1], bool)
    rows = slice(max(top, 0), max(top + height, 0))
    shown[rows, max(left, 0) : max(left + width, 0)] = True
    return shown


def place(camtopix, focal_px, own, size):
    """A scaled view's ((width, height), (left, top)): its size, its corner's place."""
    scale = focal_px / camtopix[[0, 1], [0, 1]]
    new = np.maximum(np.round(scale * own), 1).astype(int)
    axis = camtopix[:2, 2] * new / own
    corner = np.round(np.array(size) / 2 - axis).astype(int)
    return tuple(map(int, new)), tuple(map(int, corner))


def moved(pixtocam, corner):
    """Inverse intrinsics [3, 3] of the canvas; corner: the photo's (left, top)."""
    shift = np.eye(3)
    shift[:2, 2] = -np.array(corner)
    return pixtocam @ shift
