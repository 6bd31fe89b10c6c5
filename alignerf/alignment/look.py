"""Small renders of the training views at an alignment step, and their flow.

Notation: k is the factor by which renders and photos are made smaller. A pixel of a
small render is a cone k times as wide. The flow goes to the photos as taken, never to
warped photos, so a later warp replaces an earlier one.
"""

import functools
import time
from typing import NamedTuple

import numpy as np

from alignerf.experiment import jobs
from alignerf.io import machine
from alignerf.scenes import prepared
from alignerf.training import renderer
from flow.camera import correct
from flow.estimation import estimate, estimators
from flow.warping import small, warp

# Largest forward-backward disagreement of a valid pixel, in px of the small images.
TOLERANCE_PX = 1.0
# Samples a ray that the first round of proposals keeps at least.
MIN_SAMPLES = 4


class Photo(NamedTuple):
    """A small photo, and the mask of the pixels that count; None: all pixels count."""

    image: np.ndarray  # [h // k, w // k, 3] uint8
    counts: np.ndarray | None  # [h // k, w // k] bool


def with_fewer_samples(job: jobs.Job) -> jobs.Job:
    """The job, with half of the samples a ray in the first round of proposals.

    Rendering for the flow then takes two thirds of the time. With half of the samples
    in all rounds, the cameras' final error was a third larger.
    """
    first, *others = job.model.samples
    if not job.model.has_proposals:
        return job
    samples = [max(MIN_SAMPLES, first // 2), *others]
    model = job.model.model_copy(update={"samples": samples})
    return job.changed(model=model)


def factor(size, min_side_px, most):
    """k for photos of `size` (h, w): the largest whole number up to `most`.

    The smaller side of the small photos has at least min_side_px, which the flow
    estimator needs. Raises ValueError where the photos themselves have less.
    """
    side = min(size)
    if side < min_side_px:
        raise ValueError(
            f"photos of {size[1]}x{size[0]} pixels are too small to be aligned: the "
            f"flow needs {min_side_px} px a side"
        )
    return max(1, min(most, side // min_side_px))


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


def flow_of(render, photo, *, estimator):
    """(flow_px, valid) between two small images.

    valid: the flow from photo to render agrees (forward-backward check). On courtyard,
    where offsets are short, the check changed no score; it is for long offsets.
    """
    options = {"match_blur": False, "tolerance_px": TOLERANCE_PX}
    options |= {"method": estimator, "back": estimators.METHODS[estimator].checked_by}
    return estimate.flow_and_validity(render, photo, **options)[:2]


def at(render, scene: prepared.Scene, view, photo: Photo, k, flow_of) -> correct.View:
    """The `correct.View` of a training view: flow from small render to photo, depth.

    render: (pixtocam, camtoworld) -> (image, depth), a `training.renderer` of the small
    size. flow_of: (render, photo) -> (flow_px, valid), of images [h, w, 3] uint8.
    """
    pixtocam = small.shrink_pixtocam(scene.pixtocams[view], k)
    image, depth = render(pixtocam, scene.camtoworlds[view])
    target = photo.image
    if photo.counts is not None:
        # Pixels that do not count get the render itself, so that their flow is zero.
        target = np.where(photo.counts[..., None], target, image)
    try:
        flow_px, valid = flow_of(image, target)
    except ValueError as error:
        raise ValueError(f"view {scene.names[view]}: {error}") from error
    if photo.counts is not None:
        valid &= warp.sees_only(flow_px, photo.counts)
    usable = np.isfinite(depth) & (depth > 0)
    # A pixel without a depth hides nothing: it counts as far away.
    depth_or_far = np.where(usable, depth, np.float32(1e30))
    valid &= usable & warp.unoccluded(flow_px, depth_or_far)
    return correct.View(flow_px, valid, pixtocam, depth)


class Scene(NamedTuple):
    """What a training learns from, before any alignment.

    loaded: the scene with the cameras as given; views [n]: its training views; photos:
    the folder of their photos.
    """

    loaded: prepared.Scene
    views: np.ndarray
    photos: str


class Looker:
    """Small photos, which are read once, and the renderer, which is compiled once."""

    def __init__(self, method, scene: Scene, k, settings):
        """k: factor by which images are made smaller; settings: a job's `align`."""
        self.method, self.scene, self.k = method, scene, k
        self.flow_of = functools.partial(flow_of, estimator=settings.estimator)
        self.photos = self.render = None
        self.compile_time_s = 0.0

    def __call__(self, params, now: prepared.Scene, wanted):
        """`correct.View` of training views, in their order.

        params: as the training has them; now: with the cameras of now; wanted: indices
        of training views.
        """
        scene = self.scene
        if self.render is None:
            self.prepare(params)
        render = functools.partial(self.render, params)

        def one(i):
            photo = self.photos[i]
            return at(render, now, scene.views[i], photo, self.k, self.flow_of)

        return machine.map_in_threads(one, wanted)

    def prepare(self, params):
        """Read the photos, and compile the renderer."""
        loaded, k = self.scene.loaded, self.k
        self.photos = read_photos(loaded, self.scene.views, self.scene.photos, k)
        self.render = renderer.Renderer(
            self.method, loaded.width // k, loaded.height // k
        )
        # Compiling is counted apart: a cache often saves it.
        begun = time.perf_counter()
        self.render(params, loaded.pixtocams[0], loaded.camtoworlds[0])
        self.compile_time_s += time.perf_counter() - begun
