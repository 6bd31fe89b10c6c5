"""A trained method as a function from cameras to images.

Features become colours strip by strip: at 2560x1680 with N = 128 a view takes 0.4 GB
besides the model, where its features alone would take 2.2.
"""

import functools

import cv2
import jax
import jax.numpy as jnp
import numpy as np

from alignerf.contributions import strips
from alignerf.decisions import fill
from alignerf.scenes import cameras, prepared
from alignerf.systems import refine
from alignerf.training import checkpoint, compose, memory

# Rays at once: large enough to fill the machine, small enough for its memory.
CHUNK_RAYS = 4096
# Of these as many at a time on a CPU, so that what they need stays in its caches: a
# hash grid takes a quarter less time than with 128, an MLP no more.
CACHED_RAYS = 32
# Pixels whose features become colours at once, but at least a row of the image. The
# halo's rows, convolved once more with each strip, are 8 % of these at 2560 x 1680.
STRIP_PIXELS = 65536


def read_model(config, model, loaded: prepared.Scene, *, moving=False):
    """(method, its parameters) of a job as JSON, or its file, from the model's file.

    moving: renders can be differentiated in their rays.
    """
    job = fill.read_job(config)
    views = functools.partial(refine.views_of, loaded)
    method = compose.make_method(job, views, to_train=False, moving=moving)
    template = jax.eval_shape(method.init, jax.random.key(0))
    params = checkpoint.read_params(model, template)
    return method, jax.tree.map(jnp.asarray, params)


def make_renderer(method, params, width, height):
    """`make_for_params` of these parameters."""
    return functools.partial(make_for_params(method, width, height), params)


def make_for_params(method, width, height):
    """A function from parameters and a camera to an image and its depth.

    (params, pixtocam, camtoworld) -> (image [h, w, 3] uint8, depth [h, w] float32): for
    other parameters nothing is compiled anew. A fourth argument, a mask [h, w], may say
    which pixels are wanted: others are black, or no colours, with a depth of 0.
    """
    memory.keep_freed()
    count = width * height
    chunk = min(CHUNK_RAYS, -(-count // CACHED_RAYS) * CACHED_RAYS)
    on_cpu = jax.local_devices()[0].platform == "cpu"
    strip = min(height, -(-STRIP_PIXELS // width))

    @jax.jit
    def values_of(params, pixel, pixtocam, camtoworld):
        def values_at(pixel):
            rays = cameras.pixels_to_rays(
                pixel % width, pixel // width, pixtocam, camtoworld
            )
            rendering = method.render(params, rays)
            return rendering.values, rendering.depth

        parts = pixel.reshape(-1, CACHED_RAYS if on_cpu else chunk)
        values, depth = jax.lax.map(values_at, parts)
        return jnp.concatenate(values), depth.ravel()

    @jax.jit
    def colours_of(params, values):
        return jnp.clip(method.colours(params, values), 0.0, 1.0)

    def paint(params, values):
        rgb = np.asarray(colours_of(params, values))
        if not np.isfinite(rgb).all():
            raise ValueError("the model renders colours that are not finite")
        return np.round(rgb * 255.0).astype(np.uint8)

    def render(params, pixtocam, camtoworld, wanted=None):
        camera = [jnp.asarray(m, jnp.float32) for m in (pixtocam, camtoworld)]
        depths = np.zeros(count, np.float32)

        def values():
            """Of all pixels in their order; zero where a pixel is not needed."""
            done = 0
            for part in in_chunks(needed(wanted)):
                values, depths[part] = values_of(params, jnp.asarray(part), *camera)
                end = part[-1] + 1
                block = np.zeros((end - done, values.shape[-1]), values.dtype)
                block[part - done] = values
                done = end
                yield block
            if done < count:
                yield np.zeros((count - done, block.shape[-1]), block.dtype)

        size = {"width": width, "height": height, "strip": strip, "halo": method.halo}
        image = strips.colours(values(), functools.partial(paint, params), **size)
        return image, depths.reshape(height, width)

    def needed(wanted):
        """Indices of the pixels whose values the wanted ones' colours depend on."""
        if wanted is None:
            return np.arange(count)
        side = 2 * method.halo + 1
        return np.flatnonzero(
            cv2.dilate(wanted.astype(np.uint8), np.ones((side, side)))
        )

    def in_chunks(pixels):
        """Rows [chunk] of indices; the last one is filled up with its last pixel."""
        rows = -(-len(pixels) // chunk)
        return np.pad(pixels, (0, rows * chunk - len(pixels)), "edge").reshape(
            -1, chunk
        )

    return render
