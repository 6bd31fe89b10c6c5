"""LPIPS v0.1 (arXiv 1801.03924, Eq. 1): a learned perceptual distance.

    d(x, y) = sum_l mean_hw lin_l . (unit(f_l(x)) - unit(f_l(y)))^2

Notation: f_l(x) [n, h, w, c] tap l of a network, unit() divides by the length over
channels, lin_l [c] learned weights. Images [n, h, w, 3] RGB in [0, 1] are mapped to
[-1, 1] first, as the reference implementation's users do. Network and input range
are part of the number: always name the network in a column (`lpips_alex`).
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from alignerf.metrics import convnet

# Of NumPy: importing must not start JAX, which processes.devices has yet to set up.
SHIFT = np.array([[[[-0.030, -0.088, -0.188]]]], np.float32)
SCALE = np.array([[[[0.458, 0.448, 0.450]]]], np.float32)
ALEX = {
    "conv1": (11, 3, 64),
    "conv2": (5, 64, 192),
    "conv3": (3, 192, 384),
    "conv4": (3, 384, 256),
    "conv5": (3, 256, 256),
}
# Channels in, squeezed, and of each of the two expansions, of SqueezeNet 1.1.
FIRES = {
    "fire2": (64, 16, 64),
    "fire3": (128, 16, 64),
    "fire4": (128, 32, 128),
    "fire5": (256, 32, 128),
    "fire6": (256, 48, 192),
    "fire7": (384, 48, 192),
    "fire8": (384, 64, 256),
    "fire9": (512, 64, 256),
}
SQUEEZE = {"conv1": (3, 3, 64)} | {
    f"{fire}_{part}": sizes
    for fire, (c, squeezed, out) in FIRES.items()
    for part, sizes in {
        "squeeze": (1, c, squeezed),
        "expand1x1": (1, squeezed, out),
        "expand3x3": (3, squeezed, out),
    }.items()
}
VGG = {
    "conv1_1": (3, 3, 64),
    "conv1_2": (3, 64, 64),
    "conv2_1": (3, 64, 128),
    "conv2_2": (3, 128, 128),
    "conv3_1": (3, 128, 256),
    "conv3_2": (3, 256, 256),
    "conv3_3": (3, 256, 256),
    "conv4_1": (3, 256, 512),
    "conv4_2": (3, 512, 512),
    "conv4_3": (3, 512, 512),
    "conv5_1": (3, 512, 512),
    "conv5_2": (3, 512, 512),
    "conv5_3": (3, 512, 512),
}


def alex_taps(weights, x):
    """relu1 to relu5 of AlexNet."""
    layer = functools.partial(convnet.layer, weights=weights)
    yield (x := layer(x, name="conv1", stride=4, padding=2))
    yield (x := layer(convnet.max_pool(x), name="conv2", padding=2))
    yield (x := layer(convnet.max_pool(x), name="conv3", padding=1))
    yield (x := layer(x, name="conv4", padding=1))
    yield layer(x, name="conv5", padding=1)


def squeeze_taps(weights, x):
    """relu1 of SqueezeNet 1.1, fire3, fire5 (before the pooling), fire6 to fire9."""
    yield (x := convnet.layer(x, weights, "conv1", stride=2))
    for fires in (("fire2", "fire3"), ("fire4", "fire5"), ("fire6",)):
        x = convnet.max_pool(x, ceil=True)
        for fire in fires:
            x = _fire(weights, x, fire)
        yield x
    for fire in ("fire7", "fire8", "fire9"):
        yield (x := _fire(weights, x, fire))


def vgg_taps(weights, x):
    """relu1_2, 2_2, 3_3, 4_3 and 5_3 of VGG-16."""
    for name in VGG:
        if name in ("conv2_1", "conv3_1", "conv4_1", "conv5_1"):
            yield x
            x = convnet.max_pool(x, size=2)
        x = convnet.layer(x, weights, name, padding=1)
    yield x


def _fire(weights, x, name):
    x = convnet.layer(x, weights, f"{name}_squeeze")
    ones = convnet.layer(x, weights, f"{name}_expand1x1")
    threes = convnet.layer(x, weights, f"{name}_expand3x3", padding=1)
    return jnp.concatenate([ones, threes], axis=-1)


class Net(NamedTuple):
    """A network: its layers {name: (side, c, out)}, its taps and their channels."""

    layers: dict
    taps: Callable
    channels: tuple
    smallest_px: int  # the smallest side for which every tap has an output


NETS = {
    "alex": Net(ALEX, alex_taps, (64, 192, 384, 256, 256), 31),
    "squeeze": Net(SQUEEZE, squeeze_taps, (64, 128, 256, 384, 384, 512, 512), 17),
    "vgg": Net(VGG, vgg_taps, (64, 128, 256, 512, 512), 16),
}


def shapes(net):
    """{array: shape} of the weights: `<layer>_w` (HWIO), `<layer>_b`, `lin<k>`."""
    heads = {f"lin{k}": (c,) for k, c in enumerate(NETS[net].channels)}
    return convnet.layer_shapes(NETS[net].layers) | heads


def read(net, path):
    """Weights of `alex`, `squeeze` or `vgg` from an .npz; ValueError names the file."""
    return convnet.read_weights(path, shapes(net))


def distance(net, weights, first, second):
    """Distance [n] of two batches of images [n, h, w, 3] in [0, 1].

    Raises ValueError for images too small for the network.
    """
    smallest = NETS[net].smallest_px
    if min(first.shape[1:3]) < smallest:
        raise ValueError(f"under {smallest} pixels")
    return _distance(net, weights, first, second)


@functools.partial(jax.jit, static_argnums=0)
def _distance(net, weights, first, second):
    taps = NETS[net].taps
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
