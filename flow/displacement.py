"""How far render and photo are apart: the misalignment of a view.

Notation: `flow_px` [h, w, 2] x then y in pixels, `valid` [h, w] bool.
"""

import numpy as np


def statistics(flow_px, valid, *, view):
    """Length of the flow over valid pixels: median_px, mean_px, p95_px, valid_share.

    Returns a dict of floats. Raises ValueError, naming the view, where no pixel is
    valid: a mean over nothing is no misalignment.
    """
    if valid.shape != flow_px.shape[:2] or valid.dtype != bool:
        raise ValueError(f"view {view}: the validity mask does not fit the flow")
    if not valid.any():
        raise ValueError(
            f"view {view}: no pixel has a valid flow, so it has no misalignment; "
            "does the render show the scene?"
        )
    length_px = np.linalg.norm(flow_px[valid].astype(np.float64), axis=-1)
    return {
        "median_px": float(np.median(length_px)),
        "mean_px": float(length_px.mean()),
        "p95_px": float(np.percentile(length_px, 95)),
        "valid_share": float(valid.mean()),
    }
