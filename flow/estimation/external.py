"""Flows that were made elsewhere, by a learned estimator for example: method `files`.

A folder holds <view>.flo (Middlebury) or <view>.npz (`flow_px` [h, w, 2] floating,
and `valid` [h, w] bool unless all is), from render to photo in pixels of the render,
and, if there is a check to be made, <view>.back.flo or .npz from photo to render.
"""

from pathlib import Path

import numpy as np

from alignerf.io import archives
from flow.warping import files, warp

METHOD = "files"
SUFFIXES = (".flo", ".npz")
# Stands for an unknown flow where arithmetic needs a number: farther than any image.
_NOWHERE_PX = 1e6


def flow_and_validity(folder, view, shape, *, tolerance_px):
    """(flow_px [h, w, 2] float32, valid [h, w]) of a view from a folder.

    shape: (h, w) of the images. Valid: known, in frame and, where the flow back is
    there, answered by it to tolerance_px. Raises ValueError naming the file that is
    missing, or is no flow of this shape.
    """
    forward_px, known = read(folder, view, shape)
    valid = known & warp.in_frame(forward_px)
    if any(path.is_file() for path in _paths(folder, f"{view}.back")):
        backward_px, answered = read(folder, f"{view}.back", shape)
        backward_px[~answered] = _NOWHERE_PX
        valid &= warp.consistent(forward_px, backward_px, tolerance_px=tolerance_px)
    return forward_px, valid


def read(folder, name, shape):
    """(flow_px [h, w, 2] float32, known [h, w]) of <name>.flo or .npz; unknown is 0."""
    paths = [path for path in _paths(folder, name) if path.is_file()]
    if not paths:
        raise ValueError(f"{_paths(folder, name)[0]}: no such flow, nor as .npz")
    if len(paths) > 1:
        raise ValueError(f"{paths[0]}: there is {paths[1].name} too, remove one")
    read_one = files.read_flo if paths[0].suffix == ".flo" else _read_npz
    flow_px, known = read_one(paths[0])
    if flow_px.shape[:2] != tuple(shape):
        raise ValueError(
            f"{paths[0]}: a flow of {flow_px.shape[1]}x{flow_px.shape[0]} pixels, "
            f"where render and photo have {shape[1]}x{shape[0]}"
        )
    return np.where(known[..., None], flow_px, np.float32(0)), known


def _read_npz(path):
    keys = ("flow_px", "valid") if archives.has(path, "valid") else ("flow_px",)
    flow_px, *mask = archives.read(path, keys).values()
    if flow_px.dtype.kind != "f" or flow_px.ndim != 3 or flow_px.shape[2] != 2:
        raise ValueError(
            f"{path}: flow_px is {flow_px.dtype} {list(flow_px.shape)} instead of "
            "floating numbers [h, w, 2]"
        )
    # Written so that NaN is unknown too.
    known = (np.abs(flow_px) <= files.UNKNOWN_FLOW_PX).all(axis=-1)
    for valid in mask:
        if valid.dtype != bool or valid.shape != known.shape:
            raise ValueError(f"{path}: valid is not bool {list(known.shape)}")
        known &= valid
    return flow_px.astype(np.float32), known


def _paths(folder, name):
    return [Path(folder) / f"{name}{suffix}" for suffix in SUFFIXES]
