"""A camera moved by gradient descent until the model's render fits a photo.

The usual treatment of test views whose poses are off (BARF, arXiv 2104.06405, section
4.2): the model is fixed, six numbers of the camera are learnt from the photo's colours.
"""

import jax
import jax.numpy as jnp
import numpy as np
import optax

from alignerf.cameras import refine
from alignerf.mipnerf360 import losses
from alignerf.scenes import cameras

# Rays a step. A method that convolves is asked for patches of so many pixels.
RAYS, PATCH_PX = 512, 8
# Learning rate of the parameters that `refine.preconditioners` scales, first and last.
RATES = (1e-3, 1e-5)
BETAS = (0.9, 0.99)


class NoFitError(ValueError):
    """Why a camera cannot be fitted."""


def make_fitter(method, params, *, steps, patch_px=PATCH_PX):
    """A function that fits one camera: see `fit` below.

    method: a `training.methods.Method` whose render can be differentiated in its rays.
    steps: of Adam. patch_px: side of the patches of a method that convolves.
    """
    patch = patch_px if method.halo else 1
    side = patch + 2 * method.halo
    count = RAYS // patch**2
    optimizer = optax.adam(
        optax.exponential_decay(RATES[0], steps, RATES[1] / RATES[0]), *BETAS
    )

    def loss(coordinates, key, params, photo, corners, camera, scale):
        chosen = corners[jax.random.randint(key, (count,), 0, len(corners))]
        y, x = jnp.meshgrid(*[jnp.arange(side) - method.halo] * 2, indexing="ij")
        x = (chosen[:, 0, None, None] + x[None]).reshape(-1)
        y = (chosen[:, 1, None, None] + y[None]).reshape(-1)
        rays = cameras.pixels_to_rays(x, y, *camera)
        twist = refine.twists(coordinates[None], scale[None])
        twist = jnp.broadcast_to(twist, (len(x), 6))
        values = method.render(params, refine.move(rays, twist)).values
        values = values.reshape(count, side, side, -1)
        rgb = jax.vmap(lambda values: method.colours(params, values))(values)
        inner = slice(method.halo, side - method.halo)
        seen = photo[y, x].reshape(count, side, side, 3)[:, inner, inner]
        errors = (rgb.reshape(-1, 3), seen.reshape(-1, 3) / 255.0)
        return losses.charbonnier(*errors, jnp.ones(count * patch**2))

    @jax.jit
    def learn(key, *fixed):
        def step(state, key):
            coordinates, moments = state
            gradient = jax.grad(loss)(coordinates, key, *fixed)
            change, moments = optimizer.update(gradient, moments)
            return (optax.apply_updates(coordinates, change), moments), None

        start = jnp.zeros(6)
        keys = jax.random.split(key, steps)
        (coordinates, _), _ = jax.lax.scan(step, (start, optimizer.init(start)), keys)
        return coordinates

    def fit(photo, mask, pixtocam, camtoworld, *, seed):
        """The camera's pose [3, 4] as the photo's pixels under a mask ask for it.

        photo [h, w, 3] uint8, mask [h, w]. Raises NoFitError where no patch lies under
        the mask, or the pose does not stay finite.
        """
        height, width = mask.shape
        corners = corners_of(mask, patch, method.halo)
        (scale,) = refine.preconditioners(
            pixtocam[None], camtoworld[None], (width, height)
        )
        camera = [jnp.asarray(m, jnp.float32) for m in (pixtocam, camtoworld)]
        fixed = params, photo, corners, camera, jnp.float32(scale)
        coordinates = np.asarray(learn(jax.random.key(seed), *fixed))
        if not np.isfinite(coordinates).all():
            raise NoFitError("the camera does not stay finite")
        twist = np.asarray(refine.twists(coordinates[None], scale[None]))
        return refine.moved_cameras(camtoworld[None], twist)[0]

    return fit


def corners_of(mask, patch, halo):
    """Corners [h w, 2] (x, y) of the patches under a mask [h, w], repeated to h w.

    Their number does not depend on the mask, so that one compiled program serves all
    masks. A patch and its halo lie within the image.
    """
    height, width = mask.shape
    windows = np.lib.stride_tricks.sliding_window_view(mask, (patch, patch))
    whole = windows.all(axis=(2, 3))
    y, x = np.nonzero(whole)
    inside = (x >= halo) & (x + patch + halo <= width)
    inside &= (y >= halo) & (y + patch + halo <= height)
    corners = np.stack([x[inside], y[inside]], axis=-1)
    if len(corners) == 0:
        raise NoFitError(f"no patch of {patch} px lies in the half that is fitted")
    return np.resize(corners, (height * width, 2)).astype(np.int32)
