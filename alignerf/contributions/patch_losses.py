"""AligNeRF's losses of a patch: what it is compared with, and how (Eqs. 4 and 5)."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from alignerf.contributions import align_loss, frequency_loss
from alignerf.methods import base
from alignerf.networks import convnet


class Losses(NamedTuple):
    """How a rendered patch is compared with the photo around it.

    By the squared error of the render and the photo patch that fits it best (Eq. 4). A
    patch without more photo around it is compared where its rays are.
    frequency_weights: file of VGG-19, else the bank.
    """

    align_penalty: float
    frequency_weight: float
    frequency_weights: str | None = None

    def __call__(self, rgb, photo, exists):
        """See `base.Part.patch_losses`; in units of one colour value.

        Of L_PM (Eq. 4) the squared error summed over the patch and the penalty of the
        offset, both divided by the patch's number of values.
        """
        patch, squared, length_px = match_patches(
            rgb, photo, exists, self.align_penalty
        )
        shown = {"mse": jnp.mean((patch - rgb) ** 2), "offset_px": jnp.mean(length_px)}
        terms = {"data": squared}
        if self.frequency_weight:
            features = features_of(self.frequency_weights)
            frequency = frequency_loss.frequency_loss(features, patch, rgb)
            # As printed against the sum over the patch.
            terms["frequency"] = self.frequency_weight * frequency / rgb[0].size
        return terms, shown


def match_patches(rgb, photo, exists, penalty):
    """One offset a patch: (patches, L_PM a colour value, lengths in px)."""
    match = jax.vmap(functools.partial(align_loss.align, penalty=penalty))(
        rgb, photo, exists
    )
    length_px = jnp.sqrt(jnp.sum(match.offset_px.astype(jnp.float32) ** 2, axis=-1))
    # Of one offset: to the same rounding as in the search.
    squared = jax.vmap(align_loss.squared_errors)(rgb, match.patch)[:, 0, 0]
    squared = squared * match.scale
    return match.patch, jnp.mean(squared + penalty * length_px) / rgb[0].size, length_px


@functools.cache
def features_of(weights):
    """VGG-19's first block by a file of weights, or the derivative bank."""
    return convnet.vgg19_features(weights) if weights else frequency_loss.bank_features


class Part(base.Part):
    """Fine-tuning: patches, and these losses of them."""

    @property
    def patches(self):
        return self.job.alignerf

    @property
    def patch_losses(self):
        return Losses(*(getattr(self.patches, name) for name in Losses._fields))
