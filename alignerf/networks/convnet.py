"""Fixed convolutional networks: what they share, and the first block of VGG-19.

VGG-19 (arXiv 1409.1556), before its max-pool, is for the high-frequency loss. Notation:
images [n, h, w, c], kernels [kh, kw, c, out] (HWIO); a layer is (kernel's side,
channels in, channels out).
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.io import archives

VGG19 = {"conv1_1": (3, 3, 64), "conv1_2": (3, 64, 64)}
# GPUs would round products to ten bits by default: 1e-3 of a metric's value.
PRECISION = jax.lax.Precision.HIGHEST


def convolve(x, kernel, *, stride=1, padding=0):
    """Cross-correlation of images with a kernel, zero padding on all sides."""
    return jax.lax.conv_general_dilated(
        x,
        kernel,
        (stride, stride),
        [(padding, padding)] * 2,
        dimension_numbers=("NHWC", "HWIO", "NHWC"),
        precision=PRECISION,
    )


def layer(x, weights, name, **options):
    """ReLU of the convolution with `<name>_w`, `<name>_b` of the weights."""
    x = convolve(x, weights[f"{name}_w"], **options)
    return jax.nn.relu(x + weights[f"{name}_b"][None, None, None])


def max_pool(x, *, size=3, stride=2):
    """Maximum over windows that lie inside the image."""
    window, strides = (1, size, size, 1), (1, stride, stride, 1)
    return jax.lax.reduce_window(x, -jnp.inf, jax.lax.max, window, strides, "VALID")


def layer_shapes(layers):
    """{array: shape} of kernels and biases; `layers` {name: (side, c, out)}."""
    kernels = {f"{name}_w": (k, k, c, out) for name, (k, c, out) in layers.items()}
    return kernels | {f"{name}_b": (out,) for name, (_, _, out) in layers.items()}


def read_weights(path, shapes):
    """Arrays of an .npz by name, as float32; `shapes` {name: shape}.

    Raises ValueError naming the file where it is no .npz, lacks an array, or
    holds one of another shape or with a number that is not finite.
    """
    arrays = archives.read(path, shapes)
    for name, array in arrays.items():
        if array.shape != shapes[name]:
            raise ValueError(
                f"{path}: array {name} is {array.shape} instead of {shapes[name]}"
            )
        with np.errstate(over="ignore"):
            arrays[name] = array.astype(np.float32)
        if array.dtype.kind != "f" or not np.isfinite(arrays[name]).all():
            raise ValueError(f"{path}: array {name} is not of finite numbers")
    return {name: jnp.asarray(array) for name, array in arrays.items()}


def vgg19_shapes():
    """{array: shape} of the weights of `vgg19_features`."""
    return layer_shapes(VGG19) | {"mean": (3,), "std": (3,)}


def vgg19_features(path) -> Callable:
    """F = relu1_2 of VGG-19 of images in [0, 1]; `path` an .npz of `vgg19_shapes`."""
    weights = read_weights(path, vgg19_shapes())

    def relu1_2(rgb):
        mean, std = (weights[key][None, None, None] for key in ("mean", "std"))
        x = (rgb - mean) / std
        for name in VGG19:
            x = layer(x, weights, name, padding=1)
        return x

    return relu1_2
