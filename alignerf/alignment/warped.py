"""Photos of a training as alignments warp them: always those as taken, warped once.

Notation: offsets_px [n, h // k, w // k, 2] float32, in pixels of images made smaller by
k: where a pixel of a render is seen in the photo.
"""

import numpy as np
from scipy import ndimage

from alignerf.io import machine
from alignerf.scenes import prepared
from alignerf.training import batches
from flow.camera import correct
from flow.camera import fit as camera_fit
from flow.camera import motion as camera_motion
from flow.warping import small, warp

# Of a remainder that no camera explains, what is shorter is the flow's own error: in
# pixels of the small image.
MIN_MOVE_PX = 0.2
# A region whose longest remainder is shorter is an error, too.
CLEAR_PX = 0.5


def offsets(view: correct.View, correction=None, *, max_pixels):
    """offsets_px of one view, by which its photo is warped: of what no camera explains.

    correction: by which its camera moves at this step, if it does. max_pixels: that say
    where the camera is.
    """
    if correction is not None and not correction.trusted:
        # A flow that no camera explains, or too little of it, is no motion either.
        return np.zeros_like(view.flow_px)
    motion = camera_motion.STILL if correction is None else correction.motion
    fit = camera_fit.split(*view, log_focal=motion.log_focal, max_pixels=max_pixels)
    moves = moving(fit)
    still = np.zeros_like(fit.remainder_px)
    # What stays where it is needs no flow to be valid, and what moves has one.
    return np.where(moves[..., None], fit.remainder_px, still)


def moving(fit: camera_fit.Fit):
    """Pixels [h, w] that move by themselves: regions of which some part clearly does.

    On a real capture in which nothing moves, many photos have regions of 0.2 to 0.3 px,
    which are the model's faults; warped by them, they made it worse.
    """
    length_px = np.linalg.norm(fit.remainder_px, axis=-1)
    regions, count = ndimage.label(fit.moved & (length_px > MIN_MOVE_PX))
    longest_px = ndimage.maximum(length_px, regions, np.arange(count + 1))
    is_clear = longest_px > CLEAR_PX
    is_clear[0] = False
    return is_clear[regions]


def warped(views: batches.Views, offsets_px, k):
    """The views with their photos warped by offsets, and the pixels that then count."""
    n, h, w, _ = views.photos.shape
    photos = prepared.empty_images((n, h, w, 3))

    def one(i):
        if not offsets_px[i].any():
            photos[i] = views.photos[i]
            return views.valid[i]
        flow_px = small.enlarge(offsets_px[i], k, (h, w))
        photos[i] = warp.warp(views.photos[i], flow_px)
        counts = batches.unpack_valid(views.valid[i], w)
        inside = warp.in_frame(flow_px)
        if not counts.all():
            inside &= warp.sees_only(flow_px, counts)
        # Photos of which nothing holds stay as taken: something has to be learnt.
        if not inside.any():
            photos[i], inside = views.photos[i], counts
        return batches.pack_valid(inside)

    packed = list(machine.map_in_threads(one, range(n)))
    return views._replace(photos=photos, valid=np.stack(packed))
