"""A trained method as a function from cameras to images.

Features become colours strip by strip: at 2560x1680 with N = 128 a view takes 0.4 GB
besides the model, where its features alone would take 2.2.
"""

import functools

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import PartitionSpec

from alignerf.contributions import strips
from alignerf.experiment import jobs
from alignerf.processes import devices
from alignerf.scenes import cameras, prepared
from alignerf.training import checkpoint, compose, gradients, memory, methods

# Rays at once: large enough to fill the machine, small enough for its memory.
CHUNK_RAYS = 4096
# Of these as many at a time on a CPU, so that what they need stays in its caches: a
# hash grid takes a quarter less time than with 128, an MLP no more.
CACHED_RAYS = 32
# Pixels whose features become colours at once, but at least a row of the image. The
# halo's rows, convolved once more with each strip, are 8 % of these at 2560 x 1680.
STRIP_PIXELS = 65536


def read_model(config, model, loaded: prepared.Scene):
    """(method, its parameters) of a job as JSON, or its file, from the model's file."""
    job = jobs.read(config)
    method = compose.make_method(job, loaded, to_train=False)
    template = jax.eval_shape(method.init, jax.random.key(0))
    params = checkpoint.read_params(model, template)
    return method, jax.tree.map(jnp.asarray, params)


def make_renderer(method, params, width, height):
    """A function from a camera to its image and depth: a `Renderer` of parameters."""
    return functools.partial(Renderer(method, width, height), params)


class Renderer:
    """A method's images of one size: one program for all parameters and cameras.

    Renderers of one model share it, whatever the scene and the size of its photos.
    """

    def __init__(self, method, width, height, shared=None):
        """shared: devices that share a view; all accelerators, of a CPU only one."""
        memory.keep_freed()
        self.width, self.height, self.halo = width, height, method.halo
        on_cpu = jax.local_devices()[0].platform == "cpu"
        # On a CPU each renders a view.
        shared = shared or jax.local_devices()[: 1 if on_cpu else None]
        self.mesh = gradients.make_mesh(len(shared), shared)
        part = -(-width * height // (CACHED_RAYS * len(shared))) * CACHED_RAYS
        part = min(CHUNK_RAYS, part)
        self.chunk = part * len(shared)
        self.strip = min(height, -(-STRIP_PIXELS // width))
        at_once = CACHED_RAYS if on_cpu else part
        options = method.render, at_once, self.mesh
        self._render = functools.partial(render_pixels, *options)
        self.bounds = np.asarray(method.bounds, np.float32) if method.bounds else None
        self._colours = functools.partial(clipped_colours, method.colours)

    def __call__(self, params, pixtocam, camtoworld, wanted=None):
        """(image [h, w, 3] uint8, depth [h, w] float32) as a camera sees it.

        wanted [h, w]: mask of the pixels that are needed. The others are black, or have
        no meaning, and depth 0. Raises ValueError for colours that are not finite.
        """
        camera = [jnp.asarray(m, jnp.float32) for m in (pixtocam, camtoworld)]
        if self.mesh:
            params = devices.place(params, self.mesh)
        depth = np.zeros(self.width * self.height, np.float32)
        image = strips.colours(
            self.values(params, camera, self.seen_by(wanted), depth_out=depth),
            functools.partial(self.colours, params),
            width=self.width,
            height=self.height,
            strip=self.strip,
            halo=self.halo,
        )
        return image, depth.reshape(self.height, self.width)

    def seen_by(self, wanted):
        """Indices of the pixels on whose values the wanted pixels' colours depend."""
        if wanted is None:
            return np.arange(self.width * self.height)
        side = 2 * self.halo + 1
        return np.flatnonzero(
            cv2.dilate(wanted.astype(np.uint8), np.ones((side, side)))
        )

    def values(self, params, camera, pixels, *, depth_out):
        """Yield blocks [n, c]: the values of all pixels in order, 0 beside `pixels`.

        depth_out [h w]: takes the depth of the pixels, block by block.
        """
        done = 0
        for chunk in self.chunks(pixels):
            y, x = np.divmod(chunk.astype(np.int32), np.int32(self.width))
            at = np.stack([x, y])
            rendered, depth = self._render(at, params, self.bounds, *camera)
            depth_out[chunk] = depth
            end = chunk[-1] + 1
            block = np.zeros((end - done, rendered.shape[-1]), rendered.dtype)
            block[chunk - done] = rendered
            done = end
            yield block
        if done < len(depth_out):
            yield np.zeros((len(depth_out) - done, block.shape[-1]), block.dtype)

    def chunks(self, pixels):
        """Rows [chunk] of indices; the last row is filled up with its last pixel."""
        missing = -len(pixels) % self.chunk
        return np.pad(pixels, (0, missing), "edge").reshape(-1, self.chunk)

    def colours(self, params, values):
        """uint8 colours of the values of a strip, as `strips.colours` asks for them."""
        rgb = np.asarray(self._colours(params, values))
        if not np.isfinite(rgb).all():
            raise ValueError("the model renders colors that are not finite")
        return np.round(rgb * 255.0).astype(np.uint8)


@functools.partial(jax.jit, static_argnums=(0, 1, 2))
def render_pixels(render_rays, at_once, mesh, at, params, *view):
    """(values [n, c], depth [n]) of the pixels (x, y) `at` [2, n].

    Each device of a mesh renders its share, `at_once` rays after the others. view:
    bounds [3] of `methods.Method`, or None; pixtocam, camtoworld.
    """

    def of_device(at, params, bounds, *camera):
        def render(at):
            rays = cameras.pixels_to_rays(*at, *camera)
            rendering = render_rays(params, methods.bounded(rays, bounds))
            return rendering.values, rendering.depth

        parts = jnp.moveaxis(at.reshape(2, -1, at_once), 1, 0)
        values, depth = jax.lax.map(render, parts)
        return jnp.concatenate(values), depth.ravel()

    if mesh:
        specs = PartitionSpec(None, gradients.AXIS), *[PartitionSpec()] * 4
        out = PartitionSpec(gradients.AXIS)
        of_device = jax.shard_map(
            of_device, mesh=mesh, in_specs=specs, out_specs=out, check_vma=False
        )
    return of_device(at, params, *view)


@functools.partial(jax.jit, static_argnums=0)
def clipped_colours(colours, params, values):
    """Colours in [0, 1] of values."""
    return jnp.clip(colours(params, values), 0.0, 1.0)
