"""Our training and rendering as the benchmarks call them: put together as `train` does.

The rays of a step are drawn within it, on the device.
"""

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.processes import devices
from alignerf.training import batches, compose, memory, program, renderer


class Training:
    """A job's training: a call is a step."""

    def __init__(self, job, photos, method=None):
        """method: instead of the job's own."""
        self.method = method or compose.make_method(job)
        views = as_views(photos)
        params = jax.jit(self.method.init)(jax.random.key(job.seed))
        built = program.build(job, self.method, params, views)
        state = program.fresh_state(built.optimizer, params)
        self._state, self._views = devices.place((state, views), built.mesh)
        self._step = built.step
        self._schedule = program.schedule_of(job, built.mesh)
        memory.keep_freed()

    def __call__(self):
        self._state, stats = self._step(self._state, self._views, self._schedule)
        return self._state, stats

    @property
    def params(self):
        return self._state.params

    @property
    def parameters(self) -> int:
        """How many there are."""
        return sum(leaf.size for leaf in jax.tree.leaves(self.params))

    def view(self, photos, index):
        """A call that renders a view as `render_views` does, of these parameters."""
        height, width = photos.images.shape[1:3]
        # A copy: a step gives up the state that it is given.
        params = jax.tree.map(jnp.copy, self.params)
        render = renderer.make_renderer(self.method, params, width, height)
        camera = photos.pixtocams[index], photos.camtoworlds[index]
        return lambda: render(*camera)


def as_views(photos):
    """The training views as `train` loads them."""
    return batches.Views(
        photos=photos.images,
        valid=batches.all_valid(*photos.images.shape[:3]),
        pixtocams=photos.pixtocams.astype(np.float32),
        camtoworlds=photos.camtoworlds.astype(np.float32),
    )
