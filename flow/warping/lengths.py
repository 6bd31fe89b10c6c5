"""How far render and photo are apart: the misalignment of a view.

Notation: `flow_px` [h, w, 2] x then y in pixels, `valid` [h, w] bool.
"""

import numpy as np

COLUMNS = ("median_px", "mean_px", "p95_px", "valid_share")


def statistics(flow_px, valid, *, view):
    """Length of the flow over valid pixels: a float for each of COLUMNS.

    Raises ValueError, naming the view, where no pixel is valid: a mean over nothing
    is no misalignment.
    """
    if valid.shape != flow_px.shape[:2] or valid.dtype != bool:
        raise ValueError(f"view {view}: the validity mask does not fit the flow")
    if not valid.any():
        raise ValueError(
            f"view {view}: no pixel has a valid flow, so it has no misalignment; "
            "does the render show the scene?"
        )
    length_px = np.linalg.norm(flow_px[valid].astype(np.float64), axis=-1)
    lengths_px = np.median(length_px), length_px.mean(), np.percentile(length_px, 95)
    return dict(zip(COLUMNS, map(float, (*lengths_px, valid.mean())), strict=True))
