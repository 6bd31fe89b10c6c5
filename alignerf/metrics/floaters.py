"""What hangs before a camera and hides its photo: floaters of a splat, by its depth."""

import cv2
import numpy as np

# Nearer than this fraction of what the rest of the view shows; other than the photo by
# so many levels of 8 bits, blurred by so many px.
NEAR, LEVELS, BLUR_PX = 0.35, 20.0, 2.0
# The nearest percent of what is shown rightly is the rest's distance.
NEAREST = 5


def hidden(photo, render, depth, counts):
    """The fraction of a view's pixels that a floater hides; NaN without depth.

    photo, render [h, w, 3] uint8; depth [h, w]; counts [h, w]: the pixels that count.
    """
    known = counts & np.isfinite(depth) & (depth > 0)
    if not known.any():
        return float("nan")
    apart = [
        cv2.GaussianBlur(one.astype(np.float32), (0, 0), BLUR_PX)
        for one in (photo, render)
    ]
    off = np.abs(apart[0] - apart[1]).mean(axis=-1) > LEVELS
    right = known & ~off
    if not right.any():
        return float("nan")
    near = depth < NEAR * np.percentile(depth[right], NEAREST)
    return float((near & off & known).sum() / known.sum())
