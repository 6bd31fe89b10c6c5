"""A trained method as a function from cameras to images.

Features become colours strip by strip: at 2560x1680 with N = 128 a view takes 0.4 GB
besides the model, where its features alone would take 2.2. An accelerator keeps these,
and what comes back is an image and its depth.
"""

import contextlib
import functools
import threading

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import PartitionSpec

from alignerf.contributions import strips
from alignerf.experiment import jobs
from alignerf.kernels import calls
from alignerf.processes import devices
from alignerf.scenes import cameras, prepared
from alignerf.training import checkpoint, compose, gradients, memory, methods

# Rays at once: large enough to fill the machine, small enough for its memory.
CHUNK_RAYS = 4096
# Of these as many at a time on a CPU, so that what they need stays in its caches: a
# hash grid takes a quarter less time than with 128, an MLP no more.
CACHED_RAYS = 32
# On an accelerator so many rays are begun at once, and computed together: of 32 samples
# of each, a layer of 1024 channels takes 2 GB.
BEGUN_RAYS, TOGETHER_RAYS = 2**17, 2**14
# Its views under way: one is begun before another has come back.
VIEWS_UNDER_WAY = 2
# Pixels whose features become colours at once, but at least a row of the image. The
# halo's rows, convolved once more with each strip, are 8 % of these at 2560 x 1680.
STRIP_PIXELS = 65536


def read_model(config, model, loaded: prepared.Scene):
    """(method, its parameters) of a job as JSON, or its file, from the model's file."""
    job = jobs.read(config)
    method = compose.make_method(job, loaded)
    template = jax.eval_shape(method.init, jax.random.key(0))
    params = checkpoint.read_params(model, template)
    return method, jax.tree.map(jnp.asarray, params)


def make_renderer(method, params, width, height):
    """A function from a camera to its image and depth: a `Renderer` of parameters."""
    return functools.partial(Renderer(method, width, height), params)


def compile_ahead(method, params, width, height):
    """Compile what renders images of a size, by one pixel of one."""
    wanted = np.zeros((height, width), bool)
    wanted[0, 0] = True
    make_renderer(method, params, width, height)(np.eye(3), np.eye(3, 4), wanted)


class Renderer:
    """A method's images of one size: one program for all parameters and cameras.

    Renderers of one model share it, whatever the scene and the size of its photos.
    """

    def __init__(self, method, width, height, shared=None):
        """shared: devices that share a view; all accelerators, of a CPU only one."""
        memory.keep_freed()
        self.width, self.height, self.halo = width, height, method.halo
        self.accelerated = on_accelerator()
        # On a CPU each renders a view.
        shared = shared or jax.local_devices()[: None if self.accelerated else 1]
        self.mesh = gradients.make_mesh(len(shared), shared)
        part = -(-width * height // (CACHED_RAYS * len(shared))) * CACHED_RAYS
        most, at_once = CHUNK_RAYS, CACHED_RAYS
        self.turn = contextlib.nullcontext()
        if self.accelerated:
            most, at_once = BEGUN_RAYS, min(TOGETHER_RAYS, part)
            part = -(-part // at_once) * at_once
            self.turn = threading.Semaphore(VIEWS_UNDER_WAY)
        self.chunk = min(most, part) * len(shared)
        strip = min(height, -(-STRIP_PIXELS // width))
        self.layout = {"width": width, "height": height, "strip": strip}
        self.layout["halo"] = self.halo
        options = method.render, at_once, self.mesh
        self._render = functools.partial(render_pixels, *options)
        self.bounds = np.asarray(method.bounds, np.float32) if method.bounds else None
        self._colours = functools.partial(clipped_colours, method.colours)
        layout = tuple(self.layout.items())
        self._image = functools.partial(image_of, method.colours, layout)

    def __call__(self, params, pixtocam, camtoworld, wanted=None):
        """(image [h, w, 3] uint8, depth [h, w] float32) as a camera sees it.

        wanted [h, w]: mask of the pixels that are needed. The others are black, or have
        no meaning, and depth 0. Raises ValueError for colours that are not finite.
        """
        camera = [jnp.asarray(m, jnp.float32) for m in (pixtocam, camtoworld)]
        if self.mesh:
            params = devices.place(params, self.mesh)
        pixels = self.seen_by(wanted)
        if not len(pixels):
            size = self.height, self.width
            return np.zeros((*size, 3), np.uint8), np.zeros(size, np.float32)
        if self.accelerated:
            with self.turn:
                image, depth = self.on_device(params, camera, pixels)
        else:
            depth = np.zeros(self.width * self.height, np.float32)
            values = self.values(params, camera, pixels, depth_out=depth)
            colours = functools.partial(self.colours, params)
            image = strips.colours(values, colours, **self.layout)
        return image, depth.reshape(self.height, self.width)

    def on_device(self, params, camera, pixels):
        """(image, depth [h w]): all of it is begun before any of it is waited for."""
        held = None
        for chunk in self.chunks(pixels):
            rendered = self.rendered(params, camera, chunk)
            if self.mesh:
                rendered = jax.device_put(rendered, self.mesh.devices.flat[0])
            if held is None:
                count = self.width * self.height
                held = [jnp.zeros((count, *x.shape[1:]), x.dtype) for x in rendered]
            held = put(held, jnp.asarray(chunk), rendered)
        values, depth = held
        first = devices.on_first(params) if self.mesh else params
        found = self._image(first, values), depth
        (image, finite), depth = jax.device_get(found)
        check_finite(finite)
        return image, depth

    def rendered(self, params, camera, pixels):
        """(values [n, c], depth [n]) of indices of pixels, which are not waited for."""
        y, x = np.divmod(pixels.astype(np.int32), np.int32(self.width))
        return self._render(np.stack([x, y]), params, self.bounds, *camera)

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
            rendered, depth = self.rendered(params, camera, chunk)
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
        check_finite(np.isfinite(rgb).all())
        return np.round(rgb * 255.0).astype(np.uint8)


def on_accelerator():
    """Whether images are made in an accelerator's way; models ask by themselves."""
    return not calls.on_cpu()


def check_finite(finite):
    if not finite:
        raise ValueError("the model renders colors that are not finite")


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


@functools.partial(jax.jit, donate_argnums=0)
def put(held, pixels, rendered):
    """Arrays of all pixels, with what is rendered of some."""
    return [
        all_.at[pixels].set(some) for all_, some in zip(held, rendered, strict=True)
    ]


@functools.partial(jax.jit, static_argnums=(0, 1))
def image_of(colours, layout, params, values):
    """(image [h, w, 3] uint8, whether all its colours are finite) of all values."""
    clipped = functools.partial(clipped_colours, colours, params)
    rgb = strips.at_once(values, clipped, **dict(layout))
    return jnp.round(rgb * 255.0).astype(jnp.uint8), jnp.isfinite(rgb).all()
