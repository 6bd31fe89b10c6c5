"""What an alignment saw and did, for the log and for timing.json."""

import logging

import numpy as np

from alignerf.files import faults

log = logging.getLogger("alignerf")


def flow_length(seen, k):
    """{flow_px}: the median view's median flow, in px of the photos; null without one.

    seen: a `correct.View` of each view, of images made smaller by k.
    """
    medians = [
        np.median(np.linalg.norm(view.flow_px[view.valid], axis=-1))
        for view in seen
        if view.valid.any()
    ]
    return {"flow_px": k * float(np.median(medians)) if medians else None}


def staying(names, corrections, k):
    """{why a camera stays: names of these views}, of their `correct.Correction`s.

    k: factor by which the images were made smaller; reasons are in their pixels.
    """
    unit = f" (px of renders made smaller by {k})" if k > 1 else ""
    reasons = {}
    for name, correction in zip(names, corrections, strict=True):
        if correction.left_alone:
            reasons.setdefault(correction.left_alone + unit, []).append(name)
    return reasons


def say(row):
    """Log an entry of the report."""
    clauses = []
    if row["flow_px"] is not None:
        clauses.append(
            f"renders and photos of {row['views']} views are apart by "
            f"{row['flow_px']:.2f} px"
        )
    if "cameras_moved" in row:
        moved, length_px = row["cameras_moved"], row["camera_px"]
        clauses.append(f"{moved} cameras move, by {length_px:.2f} px in the median")
    if "photos_warped" in row:
        share = row["moving_share"]
        warped = row["photos_warped"]
        clauses.append(f"{warped} photos warped, {share:.1%} of the median")
    log.info("aligned at step %d: %s", row["step"], "; ".join(clauses))
    for reason, views in row.get("left_alone", {}).items():
        log.info("cameras of %s stay: %s", faults.some_names(views), reason)
