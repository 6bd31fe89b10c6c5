"""A toy flow estimator: one small shift for the whole image (Lucas and Kanade)."""

import cv2
import numpy as np

from flow.estimation.estimators import Estimator

MAX_PX = 1.0


def shift(render, photo):
    """flow_px [h, w, 2] float32 with render(x) ~ photo(x + flow(x))."""
    render, photo = (
        cv2.GaussianBlur(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY), (0, 0), 1.0)
        for image in (render, photo)
    )
    down, right = np.gradient(photo.astype(np.float32))
    slopes = np.stack([right.ravel(), down.ravel()], axis=1)
    missing = (render.astype(np.float32) - photo).ravel()
    moved_px, *_ = np.linalg.lstsq(slopes, missing, rcond=None)
    moved_px = np.clip(moved_px, -MAX_PX, MAX_PX).astype(np.float32)
    return np.broadcast_to(moved_px, (*render.shape, 2)).copy()


ESTIMATOR = Estimator(shift, min_side_px=8)
