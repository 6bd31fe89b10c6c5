"""Photos, as cameras and people leave them, to 8-bit RGB images.

Every file is decoded by Pillow, since OpenCV and COLMAP accept a truncated JPEG and
disagree on orientation, depth and colour. Handled: HEIC, EXIF orientation (applied),
16-bit (rounded to 8), grey and palette (to RGB), CMYK (to RGB), opaque alpha (dropped),
transparency where a background is given, spaces in names. Refused by name: broken
files, transparency without one (what lies behind is unknown), floating-point images,
two files of one view name, names that cannot be printed. Left out: hidden files; others
that are no images, with a warning. Colour profiles are ignored: they are the same for
all photos of a camera.
"""

import contextlib
import logging
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import pillow_heif
from PIL import ExifTags, Image

from alignerf.io import faults, images
from alignerf.scenes import distortion, photo_names, prepare, prepared

log = logging.getLogger(__name__)

SUFFIXES = photo_names.SUFFIXES
# What a file of such a name may hold. Pillow knows more, some by other programs.
FORMATS = ("JPEG", "PNG", "TIFF", "BMP", "WEBP", "HEIF")
# Pillow refuses twice its warning's size, as does all that is read without Pillow.
MAX_PIXELS = 2 * Image.MAX_IMAGE_PIXELS
PNG = b"\x89PNG\r\n\x1a\n"
# Pillow's words for PNGs of 16 bits, of whose colours it drops the lower 8.
DEEP = ("RGB;16B", "RGBA;16B")
# Google's name of a panorama, in the XMP that cameras write.
EQUIRECTANGULAR, HEAD_BYTES = b"equirectangular", 2**16
# So many photos are looked at.
SOME = 5
EXIF, TAG = ExifTags.IFD.Exif, ExifTags.Base
# Two views fix no scale, and three are the least that anything can be trained on.
LEAST = 3
# The diagonal of 36 x 24 mm film, to which EXIF's 35 mm equivalent refers (CIPA).
FILM_DIAGONAL_MM = 43.2666

# EXIF's orientation -> what brings the rows as stored upright.
UPRIGHT = {
    1: lambda image: image,
    2: np.fliplr,
    3: lambda image: np.rot90(image, 2),
    4: np.flipud,
    5: lambda image: image.swapaxes(0, 1),
    6: lambda image: np.rot90(image, -1),
    7: lambda image: np.rot90(image, 2).swapaxes(0, 1),
    8: np.rot90,
}
# Those that change width and height, and of each orientation the one that undoes it.
SIDEWAYS = (5, 6, 7, 8)
UNDONE_BY = {o: {6: 8, 8: 6}.get(o, o) for o in UPRIGHT}

pillow_heif.register_heif_opener()


class Head(NamedTuple):
    """The facts of a photo's file that are known before its pixels are decoded."""

    # (width, height) of the rows as stored.
    size: tuple[int, int]
    # EXIF's, 1 to 8.
    orientation: int
    # Maker, model and lens, as EXIF has them; empty where it has none.
    camera: str = ""
    # Focal length by EXIF, in px of these rows; NaN where it has none.
    focal_px: float = np.nan

    def lies_as(self, size):
        """Whether turned upright, and only then, the photo has a size's shape."""
        fits = [prepare.has_shape(one, size) for one in (self.size, self.size[::-1])]
        return self.orientation in SIDEWAYS and fits == [False, True]


def find_images(folder, others=()):
    """{view: path} of the images in a folder, sorted by view: the file's stem.

    Where none lies in it, those of the folders below: there views whose stems collide
    are named by folders, too. others: known files that are no images, such as videos.
    Raises ValueError for two files of one name, for a missing folder, and for one
    without images and others.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"no folder of photos at {folder}")
    visible = [p for p in folder.iterdir() if not p.name.startswith(".")]
    paths = [p for p in visible if p.is_file() and p.suffix.lower() in SUFFIXES]
    named = photo_names.photos_of([path.name for path in paths])
    paths = [folder / name for name in named]
    depths = {path for path in paths if _is_deep_grey(path)}
    paths = [path for path in paths if path not in depths] or paths
    if not (paths or others):
        paths = [folder / path for path in photo_names.listed(folder)]
    elif unknown := {p.name for p in {*visible} - {*paths, *others}} - {"masks"}:
        few = faults.some_names(sorted(map(faults.name_of, unknown)))
        log.warning("%s: ignored %s: not images", folder, few)
    if not (paths or others):
        raise ValueError(f"no images in {folder}")
    return by_view(paths, folder)


def check_pinhole(paths, where):
    """ValueError naming a photo where most of some are panoramas, whole turns."""
    some = paths[:: max(len(paths) // SOME, 1)][:SOME]
    found = [path for path in some if is_panorama(path)]
    if 2 * len(found) > len(some):
        raise ValueError(f"{where}: {found[0].name}: {distortion.PANORAMA}")


def is_panorama(path):
    """Whether a photo says so, or is 2:1 and its borders meet; not of a broken one."""
    with contextlib.suppress(ValueError):
        with faults.opened(path) as file:
            if EQUIRECTANGULAR in file.read(HEAD_BYTES):
                return True
        width, height = head(path).size
        return width == 2 * height and meets(as_stored(path, "black"))
    return False


def meets(image):
    """Whether the left border of an image goes on at its right one.

    They differ as columns side by side do, and less than what a column shows.
    """
    grey = image.mean(axis=-1)
    left, right = grey[:, 0], grey[:, -1]

    def apart(a, b):
        return np.abs(a - b).mean()

    beside = apart(left, grey[:, 1]) + apart(right, grey[:, -2])
    seam = apart(left, right)
    return seam < beside and 2 * seam < apart(left, np.roll(left, len(left) // 8))


def by_view(paths, folder, beside=()):
    """{view: path} of files of a folder, sorted; ValueError for two of one view.

    beside: paths in it of other files, which the views' names are not to be of.
    """
    inside = [path.relative_to(folder).as_posix() for path in paths]
    names = photo_names.view_names([*{*inside, *beside}])
    found = {}
    for path in sorted(paths):
        name = names[path.relative_to(folder).as_posix()]
        # Among them bytes that are no UTF-8.
        if not prepared.is_name(name):
            raise ValueError(f"{folder}: {faults.name_of(path.name)}: rename this file")
        if name in found:
            raise ValueError(
                f"{folder}: {faults.name_of(found[name].name)} and "
                f"{faults.name_of(path.name)} have the same view name, {name}"
            )
        found[name] = path
    return dict(sorted(found.items()))


# What transparent pixels may stand on.
BACKGROUNDS = {"white": 255, "black": 0}


def check_enough(count, where):
    """Raise ValueError, naming `where`, if so many photos cannot be posed."""
    if count < LEAST:
        what = "1 photo is" if count == 1 else f"{count} photos are"
        raise ValueError(f"{where}: {what} too few: take 20 or more that overlap")


def decode(path, background=None, *, upright=True, least_px=None):
    """One image [h, w, 3] uint8, and its focal length from EXIF in px or NaN.

    background: a key of BACKGROUNDS, for transparent pixels. upright: apply EXIF's
    orientation, as a photo is meant to be seen; without, rows are as stored, as cameras
    given by others mean them. least_px: a JPEG may come smaller, which is faster, but
    no side below that. Raises ValueError naming the file for what cannot be decoded
    whole or cannot be an 8-bit RGB photo without inventing something.
    """
    with images.opened(path, FORMATS) as opened:
        turned_by = _turned_by(opened)
        # Pillow's own mode does not tell 16 bits from 8.
        deep = bool(opened.tile) and opened.tile[0].args in DEEP
        if least_px:
            opened.draft(None, (least_px, least_px))
        opened.load()
        exif = _exif(opened)
        focal_35mm_mm = exif.get(TAG.FocalLengthIn35mmFilm)
        # Nothing is copied without need: a photo of 170 megapixels takes 0.7 GB.
        orientation = exif.get(TAG.Orientation, 1) if opened.format != "TIFF" else 1
    # Outside: its ValueErrors name the file already.
    rgb = _to_rgb(opened, path, background, deep)
    if upright:
        turned = UPRIGHT[orientation if orientation in UPRIGHT else 1](rgb)
    else:
        turned = UPRIGHT[UNDONE_BY[turned_by]](rgb)
    rgb = np.ascontiguousarray(turned)
    return rgb, _focal_px(focal_35mm_mm, *rgb.shape[1::-1])


def as_stored(path, background=None):
    """The image [h, w, 3] uint8 of `decode`, its rows as they are stored."""
    return decode(path, background, upright=False)[0]


def upright(path, background=None):
    """The image [h, w, 3] uint8 of `decode`, as it is meant to be seen."""
    return decode(path, background)[0]


def _turned_by(opened):
    """The orientation that a decoder applies by itself: of HEIC, 1 of all others."""
    is_heic = opened.format == "HEIF"
    orientation = opened.info.get("original_orientation") if is_heic else 1
    return orientation if orientation in UPRIGHT else 1


def head(path) -> Head:
    """A photo's size and orientation, by its first bytes; ValueError as of `decode`."""
    with images.opened(path, FORMATS) as opened:
        exif = _exif(opened)
        texts = [exif.get(tag) for tag in (TAG.Make, TAG.Model, TAG.LensModel)]
        camera = " ".join(str(text).strip("\0 ") for text in texts if text)
        focal_px = _focal_px(exif.get(TAG.FocalLengthIn35mmFilm), *opened.size)
        if (turned_by := _turned_by(opened)) != 1:
            size = opened.size[::-1] if turned_by in SIDEWAYS else opened.size
            return Head(size, turned_by, camera, focal_px)
        orientation = exif.get(TAG.Orientation, 1)
        # Pillow turns the rows of a TIFF itself; others are none that EXIF has.
        if opened.format == "TIFF" or orientation not in UPRIGHT:
            orientation = 1
        return Head(opened.size, orientation, camera, focal_px)


def _exif(opened):
    """{tag: value} of an opened photo's EXIF; of one that cannot be read what it says.

    A photo is not worse for it: Pillow itself takes a JPEG of broken EXIF.
    """
    found = {}
    # Of a damaged one Pillow raises what its parts raise.
    with contextlib.suppress(Exception):
        exif = opened.getexif()
        found |= exif
        found = dict(exif.get_ifd(EXIF)) | found
    return found


def has_place(path):
    """Whether a photo's EXIF says where it was taken; not of a broken one."""
    with contextlib.suppress(ValueError), images.opened(path, FORMATS) as opened:
        return bool(opened.getexif().get_ifd(ExifTags.IFD.GPSInfo))
    return False


def may_be_transparent(path):
    """Whether an image has alpha, by its first bytes; ValueError as of `decode`."""
    with images.opened(path, FORMATS) as opened:
        return opened.has_transparency_data


def _to_rgb(image, path, background, deep):
    """Pillow image of any mode -> [h, w, 3] uint8; deep: of colours of 16 bits."""
    if image.mode.startswith("I"):
        deep = np.asarray(image).astype(np.int64)
        if deep.min() < 0 or deep.max() > 65535:
            raise ValueError(f"{path}: gray values outside 16 bits")
        grey = ((deep + 128) // 257).astype(np.uint8)
        return np.repeat(grey[..., None], 3, axis=-1)
    if deep:
        return _deep_rgb(path, background)
    if image.mode == "F":
        raise ValueError(f"{path}: floating-point images have no agreed brightness")
    if image.has_transparency_data:
        image = image.convert("RGBA")
        if image.getchannel("A").getextrema()[0] < 255:
            _check_background(path, background)
            return _on_background(np.asarray(image), BACKGROUNDS[background])
    return np.asarray(image if image.mode == "RGB" else image.convert("RGB"))


def _is_deep_grey(path):
    """Whether a file is a PNG of grey values of 16 bits, as depth maps are."""
    with faults.opened(path) as file:
        head = file.read(26)
    return head[:8] == PNG and head[24:] == b"\x10\x00"


def _deep_rgb(path, background):
    """[h, w, 3] uint8 of one with colours, whose lower 8 bits Pillow drops; rounded."""
    deep = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if deep is None or deep.dtype != np.uint16:
        raise ValueError(f"cannot decode {path}")
    values = ((deep.astype(np.uint32) + 128) // 257).astype(np.uint8)
    if values.shape[2] == 3:
        return np.ascontiguousarray(values[..., ::-1])
    rgba = cv2.cvtColor(values, cv2.COLOR_BGRA2RGBA)
    if rgba[..., 3].min() == 255:
        return np.ascontiguousarray(rgba[..., :3])
    _check_background(path, background)
    return _on_background(rgba, BACKGROUNDS[background])


def _check_background(path, background):
    if background is None:
        raise ValueError(
            f"{path} has transparent pixels: put it on a background first, or give the "
            "scene one (key background)"
        )


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
