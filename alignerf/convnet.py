"""What the fixed convolutional networks (VGG-19, LPIPS backbones) share.

Notation: images [n, h, w, c], kernels [kh, kw, c, out] (HWIO).
"""

import jax
import jax.numpy as jnp
import numpy as np

from alignerf import archives


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
    found = archives.read(path, names)
    found = {name: np.asarray(array, np.float32) for name, array in found.items()}
    for name, array in found.items():
        if not np.isfinite(array).all():
            raise ValueError(f"{path}: array {name} is not finite")
    return {name: jnp.asarray(array) for name, array in found.items()}
