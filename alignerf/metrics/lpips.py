"""LPIPS v0.1 (arXiv 1801.03924, Eq. 1): a learned perceptual distance.

    d(x, y) = sum_l mean_hw lin_l . (unit(f_l(x)) - unit(f_l(y)))^2

Notation: f_l(x) [n, h, w, c] tap l of a network, unit() divides by the length over
channels, lin_l [c] learned weights. Images [n, h, w, 3] RGB in [0, 1] are mapped to
[-1, 1] first, as the reference implementation's users do. Network and input range
are part of the number: always name the network in a column (`lpips_alex`).
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.networks import backbones, convnet

# Of NumPy: importing must not start JAX, which processes.devices has yet to set up.
SHIFT = np.array([[[[-0.030, -0.088, -0.188]]]], np.float32)
SCALE = np.array([[[[0.458, 0.448, 0.450]]]], np.float32)


def read(net, path):
    """Weights of `alex` or `vgg` from an .npz; ValueError names the file."""
    return convnet.read_weights(path, backbones.shapes(net))


def distance(net, weights, first, second):
    """Distance [n] of two batches of images [n, h, w, 3] in [0, 1].

    Raises ValueError for images too small for the network.
    """
    smallest = backbones.NETS[net].smallest_px
    if min(first.shape[1:3]) < smallest:
        raise ValueError(f"under {smallest} pixels")
    return _distance(net, weights, first, second)


@functools.partial(jax.jit, static_argnums=0)
def _distance(net, weights, first, second):
    taps = backbones.NETS[net].taps
    total = 0.0
    pairs = zip(*(taps(weights, _scale(x)) for x in (first, second)), strict=True)
    for k, (a, b) in enumerate(pairs):
        difference = (_unit(a) - _unit(b)) ** 2
        each = jnp.dot(difference, weights[f"lin{k}"], precision=convnet.PRECISION)
        total = total + jnp.mean(each, axis=(1, 2))
    return total


def _scale(rgb):
    return (2.0 * rgb - 1.0 - SHIFT) / SCALE


def _unit(x):
    return x / (jnp.sqrt(jnp.sum(x**2, axis=-1, keepdims=True)) + 1e-10)
