"""The pipeline's own images, 8-bit RGB PNGs: one reader, one writer.

Notation: images [h, w, 3] uint8 RGB; `size` is (width, height) in pixels. A user's
photos are of many more kinds: `scenes.photos` decodes them.
"""

import contextlib
import struct
import zlib

import numpy as np
from PIL import Image

from alignerf.files import atomic, faults

# Where a PNG's head says how deep its samples are, and of what colour type.
KIND = slice(24, 26)
RGB_8_BIT = bytes([8, 2])
# Photos hardly repeat themselves: runs are found faster than matches, and of the
# courtyard's photos they make files a tenth smaller.
WRITING = {"format": "PNG", "compress_level": 1, "compress_type": zlib.Z_RLE}
# What Pillow raises on files that are no PNG, cut short or altered.
_BROKEN = (
    OSError,
    SyntaxError,
    EOFError,
    struct.error,
    zlib.error,
    Image.DecompressionBombError,
)


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
    """A Pillow image whose pixels are yet to be read."""
    try:
        faults.check_regular(path)
        with open(path, "rb") as file:
            kind = file.read(KIND.stop)[KIND]
            file.seek(0)
            with Image.open(file, formats=["PNG"]) as image:
                # Pillow's own mode does not tell 16 bits from 8.
                if kind != RGB_8_BIT:
                    raise ValueError(f"{path}: not an 8-bit RGB PNG")
                if size is not None and image.size != tuple(size):
                    own, wanted = ("{}x{}".format(*s) for s in (image.size, size))
                    raise ValueError(f"{path}: {own} pixels, not {wanted}")
                yield image
    except _BROKEN as error:
        raise ValueError(f"{path}: not a readable image ({error})") from None
