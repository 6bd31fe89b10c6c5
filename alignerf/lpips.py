"""LPIPS v0.1 (arXiv 1801.03924): a learned perceptual distance, here AlexNet's.

Input range and network are part of the number: images [n, h, w, 3] RGB in [0, 1]
are mapped to [-1, 1] first, as the reference implementation's users do. Always
name the network in a column (`lpips_alex`).
"""

import jax
import jax.numpy as jnp

from alignerf import convnet

SHIFT = jnp.array([-0.030, -0.088, -0.188])
SCALE = jnp.array([0.458, 0.448, 0.450])
# (stride, padding, max-pool before the layer)
ALEX_LAYERS = ((4, 2, False), (1, 2, True), (1, 1, True), (1, 1, False), (1, 1, False))
# The smallest side for which every layer of AlexNet has an output.
SMALLEST_PX = 35


def read_alex(path):
    """Weights of the AlexNet variant from an .npz (conv1_w .. conv5_b, lin0 ..)."""
    names = [f"conv{i}_{part}" for i in range(1, 6) for part in ("w", "b")]
    return convnet.read_weights(path, [*names, *(f"lin{i}" for i in range(5))])


@jax.jit
def lpips_alex(weights, first, second):
    """Distance [n] of two batches of images [n, h, w, 3] in [0, 1]."""
    total = 0.0
    for layer, (a, b) in enumerate(
        zip(_alex_taps(weights, first), _alex_taps(weights, second), strict=True)
    ):
        difference = (_unit(a) - _unit(b)) ** 2
        total = total + jnp.mean(difference @ weights[f"lin{layer}"], axis=(1, 2))
    return total


def _alex_taps(weights, rgb):
    x = (2.0 * rgb - 1.0 - SHIFT) / SCALE
    for number, (stride, padding, pooled) in enumerate(ALEX_LAYERS, start=1):
        if pooled:
            x = convnet.max_pool(x)
        kernel = weights[f"conv{number}_w"]
        x = convnet.convolve(x, kernel, stride=stride, padding=padding)
        x = jax.nn.relu(x + weights[f"conv{number}_b"])
        yield x


def _unit(x):
    return x / (jnp.sqrt(jnp.sum(x**2, axis=-1, keepdims=True)) + 1e-10)
