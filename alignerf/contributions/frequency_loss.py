"""Contribution 3: the high-frequency loss (AligNeRF, Eq. 5).

    w ||F(G_i) - F(R)||^2 / (C W H),  w = 0.05

Notation: F maps an RGB patch [..., h, w, 3] in [0, 1] to C feature maps. F is
VGG-19 up to relu1_2, before its max-pool (`networks.convnet`); without weights for it
a fixed bank of oriented derivative filters, which the tables then name.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from alignerf.networks import convnet

BANK_SIGMAS_PX = (0.7, 1.4)
BANK_ANGLES = 4


def bank_features(rgb):
    """F = first Gaussian derivatives of each colour at 2 scales and 4 angles."""
    kernels = [
        derivative_kernel(sigma, np.pi * k / BANK_ANGLES)
        for sigma in BANK_SIGMAS_PX
        for k in range(BANK_ANGLES)
    ]
    size = max(len(kernel) for kernel in kernels)
    padded = [np.pad(k, (size - len(k)) // 2) for k in kernels]
    bank = jnp.asarray(np.stack(padded, axis=-1)[:, :, None, :], jnp.float32)
    # Each colour on its own, so that the filters see hue edges too.
    planes = jnp.moveaxis(rgb, -1, 1).reshape(-1, *rgb.shape[1:3], 1)
    # Beyond its border a patch goes on as it ends: zeros would be an edge.
    border = (size // 2, size // 2)
    planes = jnp.pad(planes, ((0, 0), border, border, (0, 0)), mode="edge")
    responses = convnet.convolve(planes, bank)
    responses = responses.reshape(len(rgb), 3, *responses.shape[1:])
    return jnp.moveaxis(responses, 1, -2).reshape(*rgb.shape[:3], -1)


def derivative_kernel(sigma_px, angle):
    """Gaussian derivative along `angle`, its absolute values adding up to one."""
    radius = int(np.ceil(3 * sigma_px))
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    along = x * np.cos(angle) + y * np.sin(angle)
    kernel = along * np.exp(-(x**2 + y**2) / (2 * sigma_px**2))
    return kernel / np.abs(kernel).sum()


def frequency_loss(features: Callable, photo, render):
    """Mean squared difference of the features of patches [n, p, p, 3]."""
    return jnp.mean((features(photo) - features(render)) ** 2)
