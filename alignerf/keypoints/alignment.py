"""Keypoints of tracks aligned in photos at their own size.

Photos are read one after another and patches are kept; patches of a part of the tracks
at a time, so that memory is bounded.
"""

import itertools
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float

from alignerf.io import machine, progress
from alignerf.keypoints import patches
from alignerf.keypoints.tracks import Tracks, Views, Warps, first_of_each, inverted

# A keypoint is kept that correlates with its reference, is expected to be as near to
# its place, has gone no further, and comes back to its reference: the latter three in
# px of the photo.
MIN_CORRELATION, MAX_DEVIATION_PX = 0.85, 0.1
MAX_MOVE_PX, MAX_RETURN_PX = 3.0, 0.3
# A place that is predicted further from SIFT's keypoint is not begun at.
MAX_OFF_PX = 2.0
# Sizes of the photos, one after another: a place further off is reached from the
# smaller one, and stays where the photo itself is too smooth.
LEVELS = (0.5, 1.0)
# Observations in memory at a time, and in a thread: half a gigabyte, 20 megabytes.
MAX_PATCHES, CHUNK = 200_000, 3000


class Keypoints(NamedTuple):
    """xy [o, 2] in px of the model, and which of them are aligned; references are."""

    xy: Float[np.ndarray, "o 2"]
    aligned: Bool[np.ndarray, " o"]


def align(
    tracks: Tracks, views: Views, warps: Warps, photos, *, threads=None
) -> Keypoints:
    """The `Keypoints` of all tracks.

    photos: of each view a function that reads it, grey [h, w] uint8, of any size;
    threads: how many are read at a time.
    """
    usable = np.isfinite(warps.affine).all(axis=(1, 2))
    usable &= np.isfinite(warps.predicted).all(axis=1)
    off = np.linalg.norm(warps.predicted - tracks.xy, axis=1)
    near = usable & (off < MAX_OFF_PX) & ~tracks.is_reference
    start = np.where(near[:, None], warps.predicted, tracks.xy)
    found = Keypoints(start, tracks.is_reference.copy())
    for part in parts(tracks.track, MAX_PATCHES):
        for pieces, ratios in gather(tracks, views, found.xy, photos, part, threads):
            align_part(tracks, warps, usable, found, part, pieces, ratios)
    aligned = found.aligned
    # A reference that nothing agrees with is no more than a keypoint.
    others = np.bincount(tracks.track, aligned) > 1
    aligned &= others[tracks.track]
    return Keypoints(np.where(aligned[:, None], found.xy, tracks.xy), aligned)


def parts(track, most):
    """Slices of sorted observations, of about `most`, that cut no track."""
    starts = [*first_of_each(track), len(track)]
    bounds = [0]
    for k in range(1, len(starts)):
        if starts[k] - bounds[-1] >= most or k == len(starts) - 1:
            bounds.append(int(starts[k]))
    return [slice(a, b) for a, b in itertools.pairwise(bounds)]


def gather(tracks, views, places, photos, part, threads):
    """[(`patches.Patches` of a part's observations, px of a photo in one [o, 2])].

    Of each size of LEVELS; photos are read once.
    """
    view, count = tracks.view[part], part.stop - part.start
    side = patches.KEPT
    levels = [
        (
            patches.Patches(
                np.empty((count, side, side), np.uint8), np.empty((count, 2))
            ),
            np.ones((count, 2)),
        )
        for _ in LEVELS
    ]

    def one(k):
        own = np.flatnonzero(view == k)
        if not len(own):
            return
        camera, grey = views.cameras[views.camera[k]], photos[k]()
        for level, (pieces, ratios) in zip(LEVELS, levels, strict=True):
            size = [max(1, round(level * n)) for n in grey.shape[::-1]]
            sized = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
            ratios[own] = np.array(size) / [camera.width, camera.height]
            cut = patches.cut(sized, places[part][own] * ratios[own])
            pieces.pixels[own], pieces.corners[own] = cut

    done = machine.map_in_threads(one, range(len(views.ids)), threads=threads)
    for _ in progress.over(done, "keypoints", unit="photo", total=len(views.ids)):
        pass
    return levels


def align_part(tracks, warps, usable, found: Keypoints, part, pieces, ratios):
    """Align a part's keypoints, which change in `found` where they are kept."""
    own = tracks.own[part] - part.start
    scaled = warps.take(part).scaled(ratios, own)
    xy, is_reference = found.xy[part] * ratios, tracks.is_reference[part]
    reference = tracks.xy[part] * ratios
    chosen = np.flatnonzero(usable[part] & ~is_reference)

    def one(piece):
        which = chosen[piece]
        _, number = np.unique(own[which], return_inverse=True)
        first = own[which[first_of_each(number)]]
        return which, *there_and_back(
            pieces,
            scaled.take(which),
            xy[which],
            reference[first],
            which,
            first,
            number,
        )

    with progress.heartbeat("keypoints: patches"):
        pieces_of = parts(own[chosen], CHUNK) if len(chosen) else []
        for which, places, kept in machine.map_in_threads(one, pieces_of):
            at = which[kept] + part.start
            found.xy[at] = places[kept] / ratios[which[kept]]
            found.aligned[at] = True


def there_and_back(pieces, warps, start, reference, which, first, number):
    """(places [o, 2] in photos, [o] whether they are kept) of some tracks' keypoints.

    which [o], first [t]: patches of observations and of their references, whose
    keypoints are `reference` [t, 2]; number [o]: each one's track of these.
    """
    still = np.broadcast_to(np.eye(2), (len(which), 2, 2))
    references = patches.Atlas(pieces.take(first))
    templates, whole = references.sample(
        np.arange(len(first)), reference, still[: len(first)]
    )
    seen = patches.Atlas(pieces.take(which))
    there = patches.align(
        templates[number], seen, start, warps, number, fits_slopes=True
    )
    bent = warps.bent(there.slopes[number])
    templates, _ = seen.sample(np.arange(len(which)), there.places, still)
    back = patches.align(
        templates,
        patches.Atlas(pieces.take(first[number])),
        reference[number],
        warps._replace(affine=inverted(bent)),
        np.arange(len(which)),
        fits_slopes=False,
    )
    returned = np.einsum("oij,oj->oi", bent, back.places - reference[number])
    with np.errstate(invalid="ignore"):
        kept = (
            whole[number]
            & (there.correlation > MIN_CORRELATION)
            & (there.deviation_px < MAX_DEVIATION_PX)
            & (np.linalg.norm(there.places - start, axis=1) < MAX_MOVE_PX)
            & (np.linalg.norm(returned, axis=1) < MAX_RETURN_PX)
        )
    return there.places, kept
