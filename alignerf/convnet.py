"""What the fixed convolutional networks (VGG-19, LPIPS backbones) share.

Notation: images [n, h, w, c], kernels [kh, kw, c, out] (HWIO).
"""

import zipfile

import jax
import jax.numpy as jnp
import numpy as np


def convolve(x, kernel, *, stride=1, padding=0):
    """Cross-correlation of images with a kernel, zero padding on all sides."""
    return jax.lax.conv_general_dilated(
        x,
        kernel,
        (stride, stride),
        [(padding, padding)] * 2,
        dimension_numbers=("NHWC", "HWIO", "NHWC"),
    )


def max_pool(x, *, size=3, stride=2):
    """Maximum over windows that lie inside the image."""
    return jax.lax.reduce_window(
        x, -jnp.inf, jax.lax.max, (1, size, size, 1), (1, stride, stride, 1), "VALID"
    )


def read_weights(path, names):
    """Arrays of an .npz by name, as float32.

    Raises ValueError naming the file where it is no .npz, lacks an array, or
    holds a number that is not finite.
    """
    if not zipfile.is_zipfile(path):
        raise ValueError(f"{path}: weights file not found, or not an .npz")
    with np.load(path, allow_pickle=False) as stored:
        if missing := [name for name in names if name not in stored]:
            raise ValueError(f"{path}: no array {', '.join(missing)} in it")
        found = {name: np.asarray(stored[name], np.float32) for name in names}
    for name, array in found.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{path}: array {name} is not finite")
    return {name: jnp.asarray(array) for name, array in found.items()}
