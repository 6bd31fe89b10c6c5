"""Photos of several sizes and lenses on one canvas, at one angle a pixel.

The canvas is the size that most photos have. Another photo is made larger or smaller
until its pixels cover the angle that theirs do, and is laid with its optical axis in
the middle; what lies beyond the canvas is cut off, and what it leaves free counts
nowhere.
"""

import cv2
import numpy as np

from alignerf.scenes import cameras, prepare


def views_of(names, lenses, sizes, camtoworlds, *, load, load_mask=None, where):
    """PosedViews of photos of any sizes, distortion undone, on one canvas.

    lenses: (camtopix [3, 3], distortion [5]); sizes: (width, height); load(i) is the
    photo, and load_mask(i), where there are masks, an image [h, w, 3] uint8 that is 255
    where the photo counts. Raises ValueError naming `where`, as
    `prepare.pinhole_views`.
    """
    usual = max(set(sizes), key=lambda size: (sizes.count(size), size))
    groups = {
        size: prepare.pinhole_views(
            [names[i] for i in chosen],
            [lenses[i] for i in chosen],
            camtoworlds[chosen],
            width=size[0],
            height=size[1],
            load=_of(load, chosen),
            load_mask=load_mask and _of(load_mask, chosen),
            where=where,
        )
        for size in dict.fromkeys(sizes)
        if len(chosen := [i for i, one in enumerate(sizes) if one == size])
    }
    focal_px = np.median(np.linalg.inv(groups[usual].pixtocams)[:, [0, 1], [0, 1]], 0)
    laid = [
        group if size == usual else lay(group, focal_px, usual)
        for size, group in groups.items()
    ]
    return laid[0] if len(laid) == 1 else join(laid, usual)


def _of(load, chosen):
    return lambda i: load(chosen[i])


def lay(views: prepare.PosedViews, focal_px, size):
    """Pinhole views of another size [width, height] on a canvas of this one.

    focal_px [2]: along x and y, on the canvas. A view keeps its aspect to a rounding.
    """
    camtopix = np.linalg.inv(views.pixtocams)
    places = [
        place(one, focal_px, (views.width, views.height), size) for one in camtopix
    ]

    def put(image, i, interpolation=None):
        (width, height), (left, top) = places[i]
        if interpolation is None:
            smaller = width < views.width
            interpolation = cv2.INTER_AREA if smaller else cv2.INTER_LANCZOS4
        scaled = cv2.resize(image, (width, height), interpolation=interpolation)
        canvas = np.zeros((size[1], size[0], 3), np.uint8)
        x, y = max(left, 0), max(top, 0)
        part = scaled[y - top : size[1] - top, x - left : size[0] - left]
        canvas[y : y + part.shape[0], x : x + part.shape[1]] = part
        return canvas

    def load_mask(i):
        if views.load_mask is not None:
            return put(views.load_mask(i), i)
        full = np.full((views.height, views.width, 3), 255, np.uint8)
        return put(full, i, cv2.INTER_NEAREST)

    pixtocams = [
        moved(
            cameras.rescale_intrinsics(
                pixtocam, new[0] / views.width, new[1] / views.height
            ),
            corner,
        )
        for pixtocam, (new, corner) in zip(views.pixtocams, places, strict=True)
    ]
    return views._replace(
        pixtocams=np.stack(pixtocams),
        width=size[0],
        height=size[1],
        load=lambda i: put(views.load(i), i),
        load_mask=load_mask,
    )


def place(camtopix, focal_px, own, size):
    """((width, height) it is made, (left, top) on the canvas) of one view."""
    scale = focal_px / camtopix[[0, 1], [0, 1]]
    new = np.maximum(np.round(scale * own), 1).astype(int)
    axis = camtopix[:2, 2] * new / own
    corner = np.round(np.array(size) / 2 - axis).astype(int)
    return tuple(map(int, new)), tuple(map(int, corner))


def moved(pixtocam, corner):
    """Inverse intrinsics [3, 3] of an image whose corner now lies at (left, top)."""
    shift = np.eye(3)
    shift[:2, 2] = -np.array(corner)
    return pixtocam @ shift


def join(parts, size):
    """One PosedViews of several on one canvas, one after the other."""
    counts = [len(part.names) for part in parts]
    owner = np.repeat(np.arange(len(parts)), counts)
    first = np.cumsum([0, *counts])

    def of(kind):
        def call(i):
            part = parts[owner[i]]
            function = getattr(part, kind)
            if function is None:
                return np.full((size[1], size[0], 3), 255, np.uint8)
            return function(i - first[owner[i]])

        return call

    return prepare.PosedViews(
        names=[name for part in parts for name in part.names],
        pixtocams=np.concatenate([part.pixtocams for part in parts]),
        camtoworlds=np.concatenate([part.camtoworlds for part in parts]),
        width=size[0],
        height=size[1],
        load=of("load"),
        load_mask=of("load_mask"),
    )
