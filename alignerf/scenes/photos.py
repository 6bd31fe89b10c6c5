"""A folder of photos, as cameras and people leave them, to 8-bit RGB images.

Every file is decoded once, by Pillow, since OpenCV and COLMAP accept a truncated JPEG
and disagree on orientation, depth and colour. Handled: EXIF orientation (applied),
16-bit (rounded to 8), grey and palette (to RGB), CMYK (to RGB), opaque alpha (dropped),
transparency where a background is given, spaces in names. Refused by name: broken
files, transparency without one (what lies behind is unknown), floating-point images,
two files of one view name, photos of different sizes. Ignored: hidden files; others
that are no images, with a warning. Colour profiles are ignored: they are the same for
all photos of a camera.
"""

import itertools
import logging
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from PIL import Image, ImageOps

from alignerf.command import faults, images

log = logging.getLogger(__name__)

SUFFIXES = frozenset([".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp"])
EXIF_IFD, FOCAL_35MM_TAG = 0x8769, 0xA405
# The diagonal of 36 x 24 mm film, to which EXIF's 35 mm equivalent refers (CIPA).
FILM_DIAGONAL_MM = 43.2666
# Focal lengths in EXIF are rounded to a millimetre: closer ones are the same zoom.
SAME_ZOOM = 0.04


class Photos(NamedTuple):
    """Photos of one size, as <work_folder>/<name>.png, sorted by name."""

    names: list[str]
    folder: Path
    width: int
    height: int
    focals_px: Float[np.ndarray, " n"]
    """From EXIF; NaN where a photo has none."""


def find_images(folder):
    """Paths of the images in a folder, sorted by view name (the file's stem).

    Raises ValueError for a missing or empty folder and for two files of one name.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"no folder of photos at {folder}")
    files = [p for p in folder.iterdir() if p.is_file() and not p.name.startswith(".")]
    paths = sorted(
        (p for p in files if p.suffix.lower() in SUFFIXES), key=lambda p: p.stem
    )
    others = sorted({p.name for p in files} - {p.name for p in paths})
    if others:
        log.warning("%s: ignored %s: not images", folder, faults.some_names(others))
    if not paths:
        raise ValueError(f"no images in {folder}")
    for first, second in itertools.pairwise(paths):
        if first.stem == second.stem:
            raise ValueError(
                f"{folder}: {first.name} and {second.name} have the same view name"
            )
    return paths


# What transparent pixels may stand on.
BACKGROUNDS = {"white": 255, "black": 0}


def decode(path, background=None, *, upright=True):
    """One image [h, w, 3] uint8, and its focal length from EXIF in px or NaN.

    background: a key of BACKGROUNDS, for transparent pixels. upright: apply EXIF's
    orientation, as a photo is meant to be seen; without, rows are as stored, as cameras
    given by others mean them. Raises ValueError naming the file for what cannot be
    decoded whole or cannot be an 8-bit RGB photo without inventing something.
    """
    try:
        with warnings.catch_warnings():
            # Phones take 108 megapixels; Pillow still refuses twice its warning's size.
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path) as opened:
                opened.load()
                focal_35mm_mm = opened.getexif().get_ifd(EXIF_IFD).get(FOCAL_35MM_TAG)
                image = ImageOps.exif_transpose(opened) if upright else opened.copy()
    except FileNotFoundError:
        raise
    # Decoders of damaged data raise a dozen types, and each means the same to the user.
    except Exception as error:
        raise ValueError(f"cannot decode {path}: {error}") from None
    rgb = _to_rgb(image, path, background)
    return rgb, _focal_px(focal_35mm_mm, *image.size)


def stored_size(path, background=None):
    """(width, height) of an image as its rows are stored, decoded whole to be sure."""
    image, _ = decode(path, background, upright=False)
    return image.shape[1], image.shape[0]


def ingest(folder, work_folder, background=None) -> Photos:
    """Decode every image of `folder` into `work_folder` (which must exist).

    background: as of `decode`.
    """
    paths = find_images(folder)
    sizes, focals_px = [], []
    for path in paths:
        image, focal_px = decode(path, background)
        sizes.append((image.shape[1], image.shape[0]))
        focals_px.append(focal_px)
        images.write(Path(work_folder) / f"{path.stem}.png", image)
    width, height = one_size([path.name for path in paths], sizes, folder)
    return Photos(
        names=[path.stem for path in paths],
        folder=Path(work_folder),
        width=width,
        height=height,
        focals_px=np.array(focals_px),
    )


def one_size(names, sizes, where):
    """The (width, height) that all views share; ValueError names those that differ."""
    usual = max(set(sizes), key=lambda size: (sizes.count(size), size))
    odd = [
        f"{name} ({size[0]}x{size[1]})"
        for name, size in zip(names, sizes, strict=True)
        if size != usual
    ]
    if odd:
        raise ValueError(
            f"{where}: images must have one size; {len(sizes) - len(odd)} are "
            f"{usual[0]}x{usual[1]}, but not {faults.some_names(odd)}"
        )
    return usual


def shared_focal_px(focals_px):
    """The focal length in px that EXIF gives the photos, None if it gives no one."""
    known = np.asarray(focals_px)[np.isfinite(focals_px)]
    if not len(known) or known.max() > known.min() * (1 + SAME_ZOOM):
        return None
    return float(np.median(known))


def _to_rgb(image, path, background):
    """Pillow image of any mode -> [h, w, 3] uint8."""
    if image.mode.startswith("I"):
        deep = np.asarray(image).astype(np.int64)
        if deep.min() < 0 or deep.max() > 65535:
            raise ValueError(f"{path}: grey values outside 16 bits")
        grey = ((deep + 128) // 257).astype(np.uint8)
        return np.repeat(grey[..., None], 3, axis=-1)
    if image.mode == "F":
        raise ValueError(f"{path}: floating-point images have no agreed brightness")
    if image.has_transparency_data:
        image = image.convert("RGBA")
        if image.getchannel("A").getextrema()[0] < 255:
            if background is None:
                raise ValueError(
                    f"{path} has transparent pixels: put it on a background first, or "
                    "give the scene one (key background)"
                )
            return _on_background(np.asarray(image), BACKGROUNDS[background])
    return np.asarray(image.convert("RGB"))


def _on_background(rgba, level):
    """[h, w, 3] uint8 of pixels [h, w, 4] with straight alpha before one grey level."""
    colour, alpha = rgba[..., :3].astype(np.int32), rgba[..., 3:].astype(np.int32)
    # Rounded to the nearest, in whole numbers.
    return ((colour * alpha + level * (255 - alpha) + 127) // 255).astype(np.uint8)


def _focal_px(focal_35mm_mm, width, height):
    """Focal length in px from EXIF's 35 mm equivalent, by the image's diagonal."""
    try:
        focal_mm = float(focal_35mm_mm or 0)
    except (TypeError, ValueError, ZeroDivisionError):
        return np.nan
    if not 1 <= focal_mm <= 10000:
        return np.nan
    return focal_mm / FILM_DIAGONAL_MM * float(np.hypot(width, height))
