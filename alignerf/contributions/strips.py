"""Colours of an image whose features would fill the memory, strip by strip.

A strip is a tile as wide as the image: rows that end with it are let go, those that
the next one needs again are kept, and no pixel is rendered twice. The image is padded
by reflection at its own borders only, so that no seam shows.

Notation: h, w the image's height and width, c its features; halo the pixels around
one that its colour depends on; strip the rows that a call colours.
"""

import jax
import jax.numpy as jnp
import numpy as np


def colours(values, colours_of, *, width, height, strip, halo):
    """Colours [h, w, 3] of the features' image.

    values: iterable of [n, c], features of consecutive pixels, row by row; n is free,
    and what follows the last pixel is left out. It is asked for no more than the
    strip at hand needs. colours_of: [strip + 2 halo, w + 2 halo, c] to
    [strip, w, 3], always of this one shape. Raises ValueError for an image too small
    to reflect: with halo pixels on a side, or fewer.
    """
    check_size(width, height, halo)
    values, painted_strips = iter(values), []
    kept, first = next(values), 0
    for top in range(0, height, strip):
        above, below = max(top - halo, 0), min(top + strip + halo, height)
        kept = _at_least(
            (below - above) * width, kept[(above - first) * width :], values
        )
        first = above
        rows = reflected(np.arange(top - halo, top + strip + halo), height)
        # A last strip that ends early is filled up with any row.
        rows = rows.clip(min=above) - above
        columns = reflected(np.arange(-halo, width + halo), width)
        image = kept[: (below - above) * width].reshape(below - above, width, -1)
        painted = np.asarray(colours_of(image[rows[:, None], columns]))
        painted_strips.append(painted[: height - top])
    return np.concatenate(painted_strips)


def at_once(values, colours_of, *, width, height, strip, halo):
    """As `colours`, of all values [h w, c] in an accelerator's memory: one program.

    The strips bound what the colours take besides.
    """
    check_size(width, height, halo)
    image = values.reshape(height, width, -1)
    columns = reflected(jnp.arange(-halo, width + halo), width)

    def painted(top):
        rows = reflected(top + jnp.arange(-halo, strip + halo), height)
        return colours_of(image[rows.clip(min=0)[:, None], columns])

    strips = jax.lax.map(painted, jnp.arange(0, height, strip))
    return strips.reshape(-1, *strips.shape[2:])[:height]


def check_size(width, height, halo):
    """ValueError for an image too small to reflect."""
    if min(width, height) <= halo:
        raise ValueError(f"an image of {width}x{height} pixels is too small to reflect")


def _at_least(count, kept, values):
    """`kept` and as many of the next values as make `count` pixels."""
    parts = [kept]
    while count > len(parts[0]) + sum(map(len, parts[1:])):
        parts.append(next(values))
    return np.concatenate(parts)


def reflected(index, size):
    """Indices that mirror at 0 and at size - 1, neither of them twice."""
    return size - 1 - abs(size - 1 - abs(index))
