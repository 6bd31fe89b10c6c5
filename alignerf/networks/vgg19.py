"""The first block of VGG-19, before its max-pool, for the high-frequency loss.

arXiv 1409.1556. Notation: images [n, h, w, 3] RGB in [0, 1].
"""

from collections.abc import Callable

from alignerf.networks import convnet

# {layer: (kernel's side, channels in, out)}.
LAYERS = {"conv1_1": (3, 3, 64), "conv1_2": (3, 64, 64)}
SHAPES = convnet.layer_shapes(LAYERS) | {"mean": (3,), "std": (3,)}


def features(path) -> Callable:
    """F = relu1_2 of VGG-19; `path` an .npz of conv1_1, conv1_2, mean and std."""
    weights = convnet.read_weights(path, SHAPES)

    def relu1_2(rgb):
        mean, std = (weights[key][None, None, None] for key in ("mean", "std"))
        x = (rgb - mean) / std
        for name in LAYERS:
            x = convnet.layer(x, weights, name, padding=1)
        return x

    return relu1_2
