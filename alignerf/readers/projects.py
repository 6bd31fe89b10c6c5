"""Scenes of mip-NeRF 360 as published (`360_v2.zip`), and other COLMAP projects.

A folder has `images` and the same photos made smaller in `images_2`, `images_4` and
`images_8`; `sparse/0` is a COLMAP model of the largest. Others lay photos and model
elsewhere, or have several models (`colmap_models`). Distortion is undone; 360_v2 has
none. Smaller photos have rounded sizes, so that intrinsics are scaled by the true
sizes, not by n. Without a model, LLFF's poses_bounds.npy is read.
"""

import logging
from pathlib import Path

from alignerf.readers import colmap_models, llff, shots

log = logging.getLogger(__name__)


def read(folder, images=None, masks=None, choose=None):
    """(prepare.PosedViews, names of the photos that the model has no pose for).

    images: the n of images_<n>; None for the largest that is there. masks: as of
    `ingest.find_masks`. choose: as of `colmap_models.with_photos`. Raises ValueError
    with one line that names the file or photo.
    """
    folder, chosen = Path(folder), None
    if images is not None:
        chosen = folder / ("images" if images == 1 else f"images_{images}")
        if not chosen.is_dir():
            raise ValueError(f"{folder}: no folder {chosen.name}")
    own = colmap_models.with_photos(folder, chosen, choose)
    if own is None:
        return of_llff(folder, chosen, masks), []
    return shots.views_of(own, masks=masks), own.left_out


def of_llff(folder, chosen, masks):
    """The views of poses_bounds.npy; ValueError where there is none either."""
    lacking = colmap_models.missing(folder)
    if not (folder / "poses_bounds.npy").is_file():
        if not lacking and (folder / "sparse/0").is_dir():
            lacking = (
                f"{folder}/sparse/0: no COLMAP model in it, as where COLMAP has failed:"
                " move sparse away, and it runs on the photos"
            )
        raise ValueError(lacking or f"{folder}: neither sparse/0 nor poses_bounds.npy")
    why = lacking or f"{folder}/sparse/0 not found"
    log.warning("%s: poses of poses_bounds.npy", why)
    return llff.read(folder, chosen, masks)
