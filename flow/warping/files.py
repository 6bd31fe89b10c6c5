"""Flow files, which are whole where they exist, and lengths of flows.

Notation: `flow_px` [h, w, 2] float32, x then y in pixels; `valid` [h, w] bool.
"""

import csv
import logging
from pathlib import Path

import numpy as np

from alignerf.io import archives, atomic, faults
from flow.warping import warp

log = logging.getLogger("alignerf")

# Middlebury's mark for "unknown" is any component beyond this.
UNKNOWN_FLOW_PX = 1e9
# How far render and photo are apart: the misalignment of a view.
LENGTHS = ("median_px", "mean_px", "p95_px")
STATISTICS = (*LENGTHS, "valid_fraction")


def write_rows(path, columns, rows):
    """Write dicts as CSV, where the caller has made room for it (see `atomic`)."""
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def write_flow(path, flow_px, valid):
    """Write a flow [h, w, 2] and its mask [h, w] as .npz."""
    flow_px, valid = np.asarray(flow_px, dtype=np.float32), np.asarray(valid)
    _check_flow_file(path, flow_px, valid)
    with atomic.replace_file(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, flow_px=flow_px, valid=valid)


def read_flow(path):
    """Read (flow_px [h, w, 2] float32, valid [h, w] bool) from .npz.

    Raises ValueError naming the file where it is no such archive.
    """
    flow_px, valid = archives.read(path, ("flow_px", "valid")).values()
    _check_flow_file(path, flow_px, valid)
    return flow_px, valid


def masked_photo(view, render, photo, masks):
    """(the photo, the render in it where it does not count; where it counts or None).

    masks: folder of <view>.npz with `valid` [h, w], or a path where there is none: then
    all counts. What does not count would else be matched to something.
    """
    if masks is None or not Path(masks).is_dir():
        return photo, None
    path = Path(masks) / f"{view}.npz"
    counts = archives.read(path, ["valid"])["valid"]
    if counts.dtype != bool or counts.shape != photo.shape[:2]:
        raise ValueError(f"{path}: valid is not of its photo's size")
    return np.where(counts[..., None], photo, render), counts


def read_split(path, split, *keys):
    """{view: its part of each named array} of a split of a cameras.npz, by name.

    The arrays begin with the axis of `names` [n] and `split` [n]. Raises ValueError
    naming the file.
    """
    columns = archives.read(path, ("names", "split", *keys))
    names, splits, *arrays = columns.values()
    views = {
        str(names[i]): [a[i] for a in arrays] for i in np.flatnonzero(splits == split)
    }
    if not views:
        raise ValueError(f"{path}: no view in split {split!r}")
    return dict(sorted(views.items()))


def read_flo(path):
    """Read Middlebury's .flo as (flow_px, valid); unknown pixels are 0 and invalid."""
    data = faults.content(path, archives.MAX_BYTES)
    width, height = (
        (int(side) for side in np.frombuffer(data, "<i4", 2, offset=4))
        if len(data) >= 12
        else (0, 0)
    )
    expected = 12 + 8 * width * height
    if data[:4] != b"PIEH" or min(width, height) < 1 or len(data) != expected:
        raise ValueError(f"{path}: not a Middlebury .flo file")
    flow_px = np.frombuffer(data, "<f4", offset=12).reshape(height, width, 2)
    # Written so that NaN is unknown too.
    valid = (np.abs(flow_px) <= UNKNOWN_FLOW_PX).all(axis=-1)
    return np.where(valid[..., None], flow_px, np.float32(0)), valid


def _check_flow_file(path, flow_px, valid):
    warp.check_flow(flow_px, f"{path}: flow_px")
    if flow_px.dtype != np.float32:
        raise ValueError(f"{path}: flow_px must be float32, not {flow_px.dtype}")
    if valid.dtype != bool or valid.shape != flow_px.shape[:2]:
        raise ValueError(
            f"{path}: valid must be bool {list(flow_px.shape[:2])}, "
            f"not {valid.dtype} {list(valid.shape)}"
        )


def statistics(flow_px, valid, *, view):
    """STATISTICS of the flow over valid pixels, as of `lengths`."""
    if valid.shape != flow_px.shape[:2] or valid.dtype != bool:
        raise ValueError(f"view {view}: the validity mask does not fit the flow")
    return lengths(flow_px[valid]) | {"valid_fraction": float(valid.mean())}


def lengths(vectors_px):
    """LENGTHS of vectors [n, 2]; empty of none: a mean over nothing is no number."""
    if not len(vectors_px):
        return dict.fromkeys(LENGTHS, "")
    length_px = np.linalg.norm(vectors_px.astype(np.float64), axis=-1)
    values = np.median(length_px), length_px.mean(), np.percentile(length_px, 95)
    return dict(zip(LENGTHS, map(float, values), strict=True))


def tell_unknown(rows, what, why):
    """Log the views of `statistics` without a valid pixel; ValueError where all are."""
    lost = [row["view"] for row in rows if not row["valid_fraction"]]
    if lost and len(lost) == len(rows):
        raise ValueError(f"no view has {what}: {why}")
    if lost:
        named = faults.some_names(lost)
        log.warning("left out: no pixel has %s in %s: %s", what, named, why)
