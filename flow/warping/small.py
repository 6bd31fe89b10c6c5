"""Images made smaller for a flow, and the flow made large again.

Notation: k the factor; an image [h, w, 3] becomes [h // k, w // k, 3], pixel (x, y) of
it the mean of the block that begins at (k x, k y). Rows and columns that fill no block
are left out. `flow_px` is in pixels of the small image, or of the large one where a
name says so.
"""

import cv2
import numpy as np


def shrink(image, k):
    """The image [h // k, w // k, 3] uint8, by the mean of each block."""
    h, w = image.shape[0] // k, image.shape[1] // k
    if k == 1:
        return image
    whole = np.ascontiguousarray(image[: h * k, : w * k])
    return cv2.resize(whole, (w, h), interpolation=cv2.INTER_AREA)


def shrink_mask(mask, k):
    """The mask [h // k, w // k]: true where the whole block is."""
    h, w = mask.shape[0] // k, mask.shape[1] // k
    return mask[: h * k, : w * k].reshape(h, k, w, k).all(axis=(1, 3))


def shrink_pixtocam(pixtocam, k):
    """Inverse intrinsics [3, 3] of the small image: its cones are k times as wide."""
    return pixtocam @ np.diag([k, k, 1.0])


def enlarge(flow_px, k, size):
    """The flow [h, w, 2] in pixels of the large image; bilinear, borders go on.

    size: (h, w).
    """
    y, x = np.indices(size, np.float32)
    at = [(axis + 0.5) / k - 0.5 for axis in (x, y)]
    small_px, border = np.asarray(flow_px, np.float32), cv2.BORDER_REPLICATE
    return np.float32(k) * cv2.remap(small_px, *at, cv2.INTER_LINEAR, borderMode=border)
