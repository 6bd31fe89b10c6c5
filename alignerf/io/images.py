"""The pipeline's own images, 8-bit RGB PNGs: one reader, one writer.

Notation: images [h, w, 3] uint8 RGB; `size` is (width, height) in pixels. A user's
photos are of many more kinds: `scenes.photos` decodes them.
"""

import contextlib
import warnings
import zlib

import numpy as np
from PIL import Image, UnidentifiedImageError

from alignerf.io import atomic, faults

# Photos hardly repeat themselves: runs are found faster than matches, and of the
# courtyard's photos they make files a tenth smaller.
WRITING = {"format": "PNG", "compress_level": 1, "compress_type": zlib.Z_RLE}


def read(path, *, size=None) -> np.ndarray:
    """The image of a PNG, of this size unless None.

    Raises ValueError naming the file where it is missing, broken, of another size or
    of another kind.
    """
    with _opened(path, size) as image:
        # A copy of its own: what Pillow lends cannot be written to.
        return np.array(image)


def check(path, *, size=None):
    """Raise early, by the file's head alone, most of the errors of `read`."""
    with _opened(path, size):
        pass


def of_mask(mask):
    """An image [h, w, 3] of a mask [h, w]: white where it holds, else black."""
    return np.where(mask[..., None], np.uint8(255), np.uint8(0)).repeat(3, axis=-1)


def write(path, image):
    """Write an image as PNG, whole or not at all; ValueError where it is none."""
    image = np.asarray(image)
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise ValueError(
            f"{path}: an image must be uint8 [h, w, 3], "
            f"not {image.dtype} {list(image.shape)}"
        )
    with atomic.replace_file(path) as temporary:
        Image.fromarray(image).save(temporary, **WRITING)


def write_mask(path, mask):
    """Write a mask [h, w] as a PNG of one channel, as other programs take masks."""
    with atomic.replace_file(path) as temporary:
        Image.fromarray(of_mask(mask)[..., 0]).save(temporary, **WRITING)


@contextlib.contextmanager
def _opened(path, size):
    """A Pillow image of ours whose pixels are yet to be read."""
    with opened(path, ["PNG"]) as image:
        # Pillow's own mode does not tell 16 bits from 8.
        if image.tile[0].args != "RGB":
            raise faults.Named(f"{path}: not an 8-bit RGB PNG")
        if size is not None and image.size != tuple(size):
            own, wanted = ("{}x{}".format(*s) for s in (image.size, size))
            raise faults.Named(f"{path}: {own} pixels, not {wanted}")
        yield image


@contextlib.contextmanager
def opened(path, formats):
    """A Pillow image whose pixels are yet to be read; its faults name the file."""
    try:
        with warnings.catch_warnings(), faults.opened(path) as file:
            # Phones take 108 megapixels; Pillow still refuses twice its warning's size.
            # All other warnings are of EXIF that is odd.
            warnings.simplefilter("ignore")
            with Image.open(file, formats=formats) as image:
                yield image
    except faults.Named:
        raise
    except UnidentifiedImageError:
        raise ValueError(f"cannot decode {path}: no {', '.join(formats)}") from None
    # Decoders of damaged data raise a dozen types, and each means the same to the user.
    except Exception as error:
        raise ValueError(f"cannot decode {path}: {error}") from None
