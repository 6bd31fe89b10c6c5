"""The posed views of a source, and the folder written from them, which training reads.

Notation: n views of one size; `pixtocams` [n, 3, 3], `camtoworlds` [n, 3, 4] as in
`cameras`; images [h, w, 3] uint8 RGB, undistorted.
"""

import collections
import functools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from jaxtyping import Float

from alignerf.io import images, machine, progress
from alignerf.scenes import cameras, prepared

# Under this no method of the analysis works: SSIM needs 11 pixels, flow more.
MIN_SIZE_PX = 32
# Rounding a photo's size at a smaller scale changes its shape by less than this.
SAME_SHAPE = 1.02
# Of 170 megapixels a photo takes 0.7 GB: not one for each core.
THREADS = 4
# Of a mask that was resampled: less is a pixel that something else has touched.
WHITE = 254


class Photo(NamedTuple):
    """A view's photo or mask, read when it is needed: together they fill the memory.

    source: a path, or what else the first step takes. Each step takes what the step
    before it gives; the last one gives [h, w, 3] uint8. file: where the source is no
    path, that of the photo.
    """

    source: Any
    steps: tuple[Callable, ...] = ()
    file: Any = None

    @property
    def path(self):
        """The path of its file; None where it has none."""
        found = [one for one in (self.file, self.source) if isinstance(one, str | Path)]
        return Path(found[0]) if found else None

    def then(self, step):
        """The photo with one more step."""
        return self._replace(steps=(*self.steps, step))

    def read(self):
        """The image [h, w, 3] uint8."""
        image = self.source
        for step in self.steps:
            image = step(image)
        return image


class PosedViews(NamedTuple):
    """What every source hands over."""

    names: list[str]
    pixtocams: Float[np.ndarray, "n 3 3"]
    camtoworlds: Float[np.ndarray, "n 3 4"]
    width: int
    height: int
    photos: list[Photo]
    """Undistorted."""
    points: tuple[np.ndarray, np.ndarray] | None = None
    """What COLMAP has triangulated: positions and colors (uint8), both [m, 3]."""
    bounds: Float[np.ndarray, "n 2"] | None = None
    """Nearest and farthest depth of each view, where LLFF gives them."""
    split: np.ndarray | None = None
    """`train` or `test` of each view, where the source says so."""
    masks: list[Photo] | None = None
    """255 where a pixel of the photo counts; a mask takes every step that its photo
    takes. None where all pixels of all photos count."""
    lens: dict | None = None
    """{"camtopix" [n, 3, 3], "distortion" [n, 5]} that was undone after all else, in px
    of the photos in full; None where nothing was."""


def all_count(width, height) -> Photo:
    """The mask of a photo whose pixels all count."""
    full = functools.partial(np.full, fill_value=255, dtype=np.uint8)
    return Photo((height, width, 3), (full,))


def has_shape(size, other):
    """Whether two sizes (width, height) have one shape, but for rounding."""
    across = size[0] / other[0], size[1] / other[1]
    return 1 / SAME_SHAPE < across[0] / across[1] < SAME_SHAPE


def usual_size(sizes):
    """The (width, height) that most have; of equally many the largest."""
    return max(set(sizes), key=lambda size: (sizes.count(size), size))


def true_scale(given_size, true_size, *, where):
    """[3, 3] from pixels of a camera's (width, height) to those of its photo.

    Intrinsics may be those of the photo at another size than it is stored in. Raises
    ValueError naming `where` for sizes that are not positive or of another shape.
    """
    # As Python's numbers, of which the smallest are divided by without a warning.
    given_width, given_height = given_size = (*map(float, given_size),)
    width, height = true_size
    if min(given_size) <= 0:
        raise ValueError(f"{where}: width and height of its camera must be positive")
    scale = np.array([width / given_width, height / given_height])
    if not has_shape(true_size, given_size):
        raise ValueError(
            f"{where} is {width:g}x{height:g}, which is another shape than its "
            f"camera's {given_width:g}x{given_height:g}"
        )
    return np.diag([*scale, 1.0])


def join(groups: list[PosedViews], *, masked) -> PosedViews:
    """The views of all groups, which have one size, one group after the other.

    masked: whether the result has masks; in a group without masks all pixels count.
    """
    width, height = groups[0].width, groups[0].height
    full = all_count(width, height)
    masks = [views.masks or [full] * len(views.names) for views in groups]
    return PosedViews(
        names=[name for views in groups for name in views.names],
        pixtocams=np.concatenate([views.pixtocams for views in groups]),
        camtoworlds=np.concatenate([views.camtoworlds for views in groups]),
        width=width,
        height=height,
        photos=[photo for views in groups for photo in views.photos],
        masks=[mask for group in masks for mask in group] if masked else None,
    )


def sort_by_name(views: PosedViews) -> PosedViews:
    """The views in the order of their names, on which the split depends."""
    return select(views, np.argsort(views.names, kind="stable"))


def select(views: PosedViews, order) -> PosedViews:
    """The views of these indices, in this order."""
    return views._replace(
        names=[views.names[i] for i in order],
        pixtocams=np.asarray(views.pixtocams)[order],
        camtoworlds=np.asarray(views.camtoworlds)[order],
        photos=[views.photos[i] for i in order],
        masks=views.masks and [views.masks[i] for i in order],
        bounds=None if views.bounds is None else views.bounds[order],
        split=None if views.split is None else views.split[order],
    )


def factor_for(views: PosedViews, pixels: int, side_px: int) -> int:
    """The least factor of `downscale` that leaves at most `pixels` in all views.

    No side becomes shorter than `side_px`, however many pixels that leaves.
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

    def smaller_of(photo):
        return photo.then(lambda image: shrink(image, width, height))

    return views._replace(
        pixtocams=cameras.rescale_intrinsics(
            views.pixtocams, width / views.width, height / views.height
        ),
        width=width,
        height=height,
        photos=list(map(smaller_of, views.photos)),
        masks=views.masks and list(map(smaller_of, views.masks)),
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
    write_photos(folder / "images", views)
    if views.masks is not None:
        write_masks(folder / prepared.MASKS, views)
    write_cameras(folder / "cameras.npz", views, split=split)
    if views.points is not None:
        positions, colours = views.points
        np.savez(folder / prepared.POINTS, points=positions, colours=colours)
    if views.bounds is not None:
        np.savez(folder / prepared.BOUNDS, bounds=views.bounds)


def write_photos(folder, views: PosedViews, suffix=".png"):
    """Write <folder>/<name>.png of each view; the folder may be there."""
    folder.mkdir(parents=True, exist_ok=True)
    each_photo(
        views, lambda name, image: images.write(folder / f"{name}{suffix}", image)
    )


def each_photo(views: PosedViews, call, title="images"):
    """Call a function of the name and image of each view, in a few threads.

    As many photos are in memory at once.
    """

    def read(i):
        call(views.names[i], views.photos[i].read())

    threads, count = min(machine.cores(), THREADS), len(views.names)
    done = machine.map_in_threads(read, range(count), threads=threads)
    collections.deque(progress.over(done, title, total=count), maxlen=0)


def write_masks(folder, views: PosedViews):
    """Write <name>.npz with `valid` [h, w], where a view's pixels count.

    A resampled pixel counts where all pixels that it was made of count. Raises
    ValueError naming a view in which no pixel counts.
    """
    folder.mkdir()
    for i, name in progress.over(enumerate(views.names), "masks"):
        valid = (views.masks[i].read() >= WHITE).all(axis=-1)
        if not valid.any():
            mask = views.masks[i].path
            raise ValueError(f"{mask or name}: it leaves no pixel of the view {name}")
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
