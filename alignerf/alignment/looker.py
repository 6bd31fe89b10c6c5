"""Looks at the training views while a training stops: renders, and their flow."""

import functools
import time
from typing import NamedTuple

import numpy as np

from alignerf.alignment import look
from alignerf.processes import devices
from alignerf.scenes import prepared
from alignerf.training import renderer


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
        self.flow_of = functools.partial(
            look.flow_of,
            estimator=settings.estimator,
            match_blur=settings.match_blur,
        )
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
            return look.at(render, now, scene.views[i], photo, self.k, self.flow_of)

        return devices.map_in_threads(one, wanted)

    def prepare(self, params):
        """Read the photos, and compile the renderer."""
        loaded, k = self.scene.loaded, self.k
        self.photos = look.read_photos(loaded, self.scene.views, self.scene.photos, k)
        self.render = renderer.Renderer(
            self.method, loaded.width // k, loaded.height // k
        )
        # Compiling is counted apart: a cache often saves it.
        begun = time.perf_counter()
        self.render(params, loaded.pixtocams[0], loaded.camtoworlds[0])
        self.compile_time_s += time.perf_counter() - begun
