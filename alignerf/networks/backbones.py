"""The networks that LPIPS compares images in: AlexNet and VGG-16.

Notation: a layer is (kernel's side, channels in, channels out); a tap is a layer's
output [n, h, w, c] that LPIPS looks at.
"""

import functools
from collections.abc import Callable
from typing import NamedTuple

from alignerf.networks import convnet

ALEX = {
    "conv1": (11, 3, 64),
    "conv2": (5, 64, 192),
    "conv3": (3, 192, 384),
    "conv4": (3, 384, 256),
    "conv5": (3, 256, 256),
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


def vgg_taps(weights, x):
    """relu1_2, 2_2, 3_3, 4_3 and 5_3 of VGG-16."""
    for name in VGG:
        if name in ("conv2_1", "conv3_1", "conv4_1", "conv5_1"):
            yield x
            x = convnet.max_pool(x, size=2)
        x = convnet.layer(x, weights, name, padding=1)
    yield x


class Net(NamedTuple):
    """A network: its layers {name: (side, c, out)}, its taps and their channels."""

    layers: dict
    taps: Callable
    channels: tuple
    smallest_px: int  # the smallest side for which every tap has an output


NETS = {
    "alex": Net(ALEX, alex_taps, (64, 192, 384, 256, 256), 31),
    "vgg": Net(VGG, vgg_taps, (64, 128, 256, 512, 512), 16),
}


def shapes(net):
    """{array: shape} of the weights: `<layer>_w` (HWIO), `<layer>_b`, `lin<k>`."""
    heads = {f"lin{k}": (c,) for k, c in enumerate(NETS[net].channels)}
    return convnet.layer_shapes(NETS[net].layers) | heads
