"""Small renders of the training views at a stop of the training, and their flow.

Notation: k the factor by which renders and photos are made smaller; a small render's
cones are k times as wide. The photos are those as taken, so that warps do not add up.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from alignerf.experiment import jobs
from alignerf.scenes import prepared
from flow.camera import correct
from flow.estimation import pairs
from flow.warping import small, warp

# Largest forward-backward disagreement of a valid pixel, in px of the small images.
TOLERANCE_PX = 1.0
# Of a round of proposals.
LEAST_SAMPLES = 4


class Photo(NamedTuple):
    """A photo made small, and where it counts; None: everywhere."""

    image: np.ndarray  # [h // k, w // k, 3] uint8
    counts: np.ndarray | None  # [h // k, w // k] bool


def with_fewer_samples(job: jobs.Job) -> jobs.Job:
    """The job of the model that renders for the flow, with fewer samples a ray.

    The first round of proposals has half of its samples, and rendering takes two thirds
    of the time. With half in all rounds cameras ended a third farther from the truth.
    """
    first, *others = job.model.samples
    if job.model.kind not in ("mipnerf360", "ngp") or not others:
        return job
    samples = [max(LEAST_SAMPLES, first // 2), *others]
    return dataclasses.replace(
        job, model=dataclasses.replace(job.model, samples=samples)
    )


def factor(size, least_side_px, most):
    """k for photos of `size` (h, w): at most `most`, and a flow needs its side in px.

    Raises ValueError where even the photos as they are have less.
    """
    side = min(size)
    if side < least_side_px:
        raise ValueError(
            f"photos of {size[1]}x{size[0]} pixels are too small to be aligned: the "
            f"flow needs {least_side_px} px a side"
        )
    return max(1, min(most, side // least_side_px))


def read_photos(loaded: prepared.Scene, views, folder, k):
    """Small photos of these views, in their order."""
    masked = (loaded.folder / prepared.MASKS).is_dir()
    photos = []
    for view in views:
        (image,) = prepared.read_images(loaded, [view], folder)
        counts = None
        if masked:
            (mask,) = prepared.read_masks(loaded, [view])
            counts = small.shrink_mask(mask, k)
        photos.append(Photo(small.shrink(image, k), counts))
    return photos


def flow_of(render, photo, *, estimator, match_blur):
    """(flow_px, valid) between two small images: valid where that back agrees.

    On courtyard, where offsets are short, the check changed no score of a training. It
    is for offsets that are not.
    """
    options = {"match_blur": match_blur, "tolerance_px": TOLERANCE_PX}
    return pairs.flow_and_validity(render, photo, method=estimator, **options)[:2]


def at(render, scene: prepared.Scene, view, photo: Photo, k, flow_of) -> correct.View:
    """The `correct.View` of a view: its small render's flow to the photo, and depth.

    render: of a `training.renderer`, for the small size. flow_of: (render, photo) ->
    (flow_px, valid), of images of 8 bits.
    """
    pixtocam = small.shrink_pixtocam(scene.pixtocams[view], k)
    image, depth = render(pixtocam, scene.camtoworlds[view])
    target = photo.image
    if photo.counts is not None:
        # What does not count would else be matched to something.
        target = np.where(photo.counts[..., None], target, image)
    try:
        flow_px, valid = flow_of(image, target)
    except ValueError as error:
        raise ValueError(f"view {scene.names[view]}: {error}") from error
    if photo.counts is not None:
        valid &= warp.sees_only(flow_px, photo.counts)
    usable = np.isfinite(depth) & (depth > 0)
    near = np.where(usable, depth, np.float32(1e30))
    valid &= usable & warp.unoccluded(flow_px, near)
    return correct.View(flow_px, valid, pixtocam, depth)
