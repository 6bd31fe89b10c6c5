"""From a source's posed views to the folder that training reads.

Notation: n views of one size; `pixtocams` [n, 3, 3], `camtoworlds` [n, 3, 4] as in
`cameras`; images [h, w, 3] uint8 RGB, undistorted.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float

from alignerf.files import images, progress
from alignerf.scenes import cameras, distortion, prepared

# Under this no method of the analysis works: SSIM needs 11 pixels, flow more.
MIN_SIZE_PX = 32
# Rounding a photo's size at a smaller scale changes its shape by less than this.
SAME_SHAPE = 1.02
# How far Lanczos reaches.
KERNEL_PX = 4
# Of a mask that was resampled: less is a pixel that something else has touched.
WHITE = 254


class PosedViews(NamedTuple):
    """What every source hands over; images are loaded one by one, as they are large."""

    names: list[str]
    pixtocams: Float[np.ndarray, "n 3 3"]
    camtoworlds: Float[np.ndarray, "n 3 4"]
    width: int
    height: int
    load: Callable[[int], np.ndarray]
    """Index of a view -> its undistorted image [h, w, 3] uint8."""
    points: tuple[np.ndarray, np.ndarray] | None = None
    """What COLMAP has triangulated: positions and colours (uint8), both [m, 3]."""
    bounds: Float[np.ndarray, "n 2"] | None = None
    """Nearest and farthest depth of each view, where LLFF gives them."""
    split: np.ndarray | None = None
    """`train` or `test` of each view, where the source says so."""
    load_mask: Callable[[int], np.ndarray] | None = None
    """Index of a view -> an image [h, w, 3] uint8, 255 where its pixels count: it goes
    the way of the photo, whatever is done to that. None where all pixels count."""


def pinhole_views(
    names, lenses, camtoworlds, *, width, height, load, where, load_mask=None
):
    """PosedViews of photos as taken, each lens's distortion undone.

    lenses: (camtopix [3, 3], distortion [5]) of each view at width x height; load(i)
    is the photo [h, w, 3] uint8, load_mask(i) what of it counts. Raises ValueError
    naming `where` for a distortion that no pinhole view undoes.
    """
    pinholes = []
    for name, lens in zip(names, lenses, strict=True):
        try:
            pinholes.append(distortion.pinhole_camera(*lens, width, height))
        except ValueError as error:
            raise ValueError(f"{where}: {name}: {error}") from None

    def undistorted(load):
        return lambda i: distortion.undistort(load(i), *lenses[i], pinholes[i])

    def undistorted_mask(i):
        # What is hidden must not come through a kernel that reaches over its edge.
        hidden = eroded(load_mask(i)) if np.any(lenses[i][1]) else load_mask(i)
        return distortion.undistort(hidden, *lenses[i], pinholes[i])

    return PosedViews(
        names=names,
        pixtocams=np.linalg.inv(np.stack(pinholes)),
        camtoworlds=camtoworlds,
        width=width,
        height=height,
        load=undistorted(load),
        load_mask=load_mask and undistorted_mask,
    )


def eroded(mask):
    """A mask [h, w, 3] uint8 without what a Lanczos kernel mixes with hidden pixels."""
    side = 2 * KERNEL_PX + 1
    # Beyond the border nothing is hidden.
    return cv2.erode(mask, np.ones((side, side), np.uint8), borderValue=(255,) * 4)


def true_scale(given_size, true_size, *, where):
    """[3, 3] from pixels of a camera's (width, height) to those of its photo.

    Intrinsics may be those of the photo at another size than it is stored in. Raises
    ValueError naming `where` for sizes that are not positive or of another shape.
    """
    (given_width, given_height), (width, height) = given_size, true_size
    if min(given_size) <= 0:
        raise ValueError(f"{where}: width and height of its camera must be positive")
    scale = np.array([width / given_width, height / given_height])
    if not 1 / SAME_SHAPE < scale[0] / scale[1] < SAME_SHAPE:
        raise ValueError(
            f"{where} is {width:g}x{height:g}, which is another shape than its "
            f"camera's {given_width:g}x{given_height:g}"
        )
    return np.diag([*scale, 1.0])


def nearest_rotation(matrix, *, where):
    """The rotation [3, 3] that a printed one means; ValueError if it is none."""
    off = np.abs(matrix @ matrix.T - np.eye(3)).max()
    if off > cameras.ROTATION_ERROR or np.linalg.det(matrix) < 0:
        raise ValueError(f"{where} is not a rotation")
    u, _, vt = np.linalg.svd(matrix)
    return u @ vt


def sort_by_name(views: PosedViews) -> PosedViews:
    """The views in the order of their names, on which the split depends."""
    order = np.argsort(views.names, kind="stable")
    return views._replace(
        names=[views.names[i] for i in order],
        pixtocams=np.asarray(views.pixtocams)[order],
        camtoworlds=np.asarray(views.camtoworlds)[order],
        load=lambda i: views.load(order[i]),
        load_mask=views.load_mask and (lambda i: views.load_mask(order[i])),
        bounds=None if views.bounds is None else views.bounds[order],
        split=None if views.split is None else views.split[order],
    )


def factor_for(views: PosedViews, pixels: int, side_px: int) -> int:
    """The least factor of `downscale` that leaves all views so many pixels or fewer.

    No side becomes shorter than `side_px`, however many they are.
    """
    factor = 1
    while (
        len(views.names) * math.prod(smaller(views, factor)) > pixels
        and min(smaller(views, factor + 1)) >= side_px
    ):
        factor += 1
    return factor


def smaller(views: PosedViews, factor):
    """(width, height) of views made smaller by a factor."""
    return round(views.width / factor), round(views.height / factor)


def downscale(views: PosedViews, factor: int | float) -> PosedViews:
    """Images made smaller by area averaging; intrinsics follow the true size ratio.

    Raises ValueError where the result would be too small to analyse.
    """
    width, height = smaller(views, factor)
    if min(width, height) < MIN_SIZE_PX:
        raise ValueError(
            f"downscale: {factor} makes images of {views.width}x{views.height} "
            f"smaller than {MIN_SIZE_PX} px"
        )
    if factor == 1:
        return views

    def smaller_of(load):
        return lambda i: shrink(load(i), width, height)

    return views._replace(
        pixtocams=cameras.rescale_intrinsics(
            views.pixtocams, width / views.width, height / views.height
        ),
        width=width,
        height=height,
        load=smaller_of(views.load),
        load_mask=views.load_mask and smaller_of(views.load_mask),
    )


def shrink(image, width, height):
    """An image [h, w, 3] made smaller by area averaging; of its own size, itself."""
    if image.shape[:2] == (height, width):
        return image
    return cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)


def split_views(n, *, test_every):
    """Split [n] of names-sorted views: every test_every-th, from the first, is test."""
    is_test = np.arange(n) % test_every == 0
    if is_test.all():
        raise ValueError(f"test_every: {test_every} leaves none of {n} views to train")
    return np.where(is_test, "test", "train")


def write_views(folder, views: PosedViews, *, split):
    """Write images/<name>.png and cameras.npz into a folder.

    And `prepared.POINTS`, `BOUNDS` and MASKS/<name>.npz, where the views have them.
    """
    (folder / "images").mkdir(parents=True)
    for i, name in progress.over(enumerate(views.names), "images"):
        images.write(folder / "images" / f"{name}.png", views.load(i))
    if views.load_mask is not None:
        write_masks(folder / prepared.MASKS, views)
    write_cameras(folder / "cameras.npz", views, split=split)
    if views.points is not None:
        positions, colours = views.points
        np.savez(folder / prepared.POINTS, points=positions, colours=colours)
    if views.bounds is not None:
        np.savez(folder / prepared.BOUNDS, bounds=views.bounds)


def write_masks(folder, views: PosedViews):
    """Write <name>.npz with `valid` [h, w], where a view's pixels count.

    A pixel to which anything that does not count has contributed counts no more.
    Raises ValueError naming a view of which nothing counts.
    """
    folder.mkdir()
    for i, name in progress.over(enumerate(views.names), "masks"):
        valid = (views.load_mask(i) >= WHITE).all(axis=-1)
        if not valid.any():
            raise ValueError(f"{name}: its mask leaves no pixel")
        np.savez_compressed(folder / f"{name}.npz", valid=valid)


def write_cameras(path, views: PosedViews, *, split):
    """Write cameras.npz as every later stage reads it."""
    np.savez(
        path,
        pixtocams=np.asarray(views.pixtocams, dtype=np.float64),
        camtoworlds=np.asarray(views.camtoworlds, dtype=np.float64),
        names=np.array(views.names),
        width=views.width,
        height=views.height,
        split=split,
    )
