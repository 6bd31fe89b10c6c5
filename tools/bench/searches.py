"""Ways to search for the offset of the alignment-aware loss (AligNeRF, Eq. 4).

A way maps render [p, p, 3], photo [q, q, 3] to ||G_i - R||^2 [s, s] by (dy, dx), in
the notation of `align_loss`. The expanded ways compute |G_i|^2 - 2 G_i.R + |R|^2 of
colours less the render's mean.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.contributions import align_loss


def cut(image, dy, dx, size):
    """The part [size, size, 3] of a photo."""
    return jax.lax.dynamic_slice(image, (dy, dx, 0), (size, size, 3))


def direct(render, photo, offset):
    """Squared error at an offset (dy, dx)."""
    return jnp.sum((cut(photo, *offset, len(render)) - render) ** 2)


def all_offsets(render, photo):
    """All (dy, dx) [s^2, 2] from (0, 0), and s."""
    side = len(photo) - len(render) + 1
    return jnp.asarray(list(np.ndindex(side, side))), side


def one_by_one(render, photo):
    """One offset after the other."""
    offsets, side = all_offsets(render, photo)
    costs = jax.lax.map(functools.partial(direct, render, photo), offsets)
    return costs.reshape(side, side)


def all_at_once(render, photo):
    """s^2 parts of the photo at the same time."""
    offsets, side = all_offsets(render, photo)
    costs = jax.vmap(functools.partial(direct, render, photo))(offsets)
    return costs.reshape(side, side)


def expanded(product):
    """A way from one that gives the products G_i.R [s, s]."""

    def way(render, photo):
        mean = jnp.mean(render, axis=(0, 1))
        render, photo = render - mean, photo - mean
        return (
            box_sums(jnp.sum(photo**2, axis=-1), len(render))
            - 2 * product(render, photo)
            + jnp.sum(render**2)
        )

    return way


def box_sums(x, size):
    """Sums of all crops, from an integral image."""
    total = jnp.cumsum(jnp.cumsum(jnp.pad(x, ((1, 0), (1, 0))), axis=0), axis=1)
    rows = total[size:] - total[:-size]
    return rows[:, size:] - rows[:, :-size]


def by_convolution(render, photo):
    """The products as a convolution with the render as its kernel."""
    found = jax.lax.conv_general_dilated(
        photo[None],
        render[..., None],
        (1, 1),
        "VALID",
        dimension_numbers=("NHWC", "HWIO", "NHWC"),
        precision=jax.lax.Precision.HIGHEST,
    )
    return found[0, :, :, 0]


def by_fft(render, photo):
    """The products in the frequency domain."""
    size, side = len(photo), len(photo) - len(render) + 1
    render, photo = (
        jnp.fft.rfft2(image, (size, size), axes=(0, 1)) for image in (render, photo)
    )
    spectrum = jnp.sum(photo * jnp.conj(render), axis=-1)
    return jnp.fft.irfft2(spectrum, (size, size))[:side, :side]


def shortlisted(way, count=8):
    """The `count` least costs of a way taken again directly; the others infinite."""

    def again(render, photo):
        costs = way(render, photo)
        _, chosen = jax.lax.top_k(-costs.ravel(), min(count, costs.size))
        offsets = jnp.stack(jnp.unravel_index(chosen, costs.shape), axis=-1)
        taken = jax.lax.map(functools.partial(direct, render, photo), offsets)
        return jnp.full(costs.size, jnp.inf).at[chosen].set(taken).reshape(costs.shape)

    return again


TRAINING = "row by row"
WAYS = {
    TRAINING: align_loss.squared_errors,
    "one by one": one_by_one,
    "all at once": all_at_once,
    "convolution": expanded(by_convolution),
    "FFT": expanded(by_fft),
    "FFT, best 8 again": shortlisted(expanded(by_fft)),
}
