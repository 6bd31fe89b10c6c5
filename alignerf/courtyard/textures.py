"""What the courtyard's textures are made of: photographs cut up, and noise.

Notation: images [h, w, 3] float32 in 0..1 (sRGB values), textures [h, w, 3] uint8;
`detail` [h, w] float32 has mean 0 and standard deviation about 1; sizes in texels.
A *pyramid* is a texture and its halvings, which keep rendered images band-limited.
Photographs are those that scikit-image ships in its wheel: nothing is downloaded.

No texture repeats: on a ground of mirrored tiles COLMAP registers every view at a
low reprojection error with the cameras in wrong places. Photographs are therefore
cut into rotated, sheared, scaled crops, blended, and varied by noise of all scales.
"""

import functools

import cv2
import numpy as np
from skimage import data


@functools.cache
def photograph(name):
    """Bundled photograph [h, w, 3] float32 in 0..1 (read once, nothing downloaded)."""
    image = getattr(data, name)()
    if isinstance(image, tuple):
        # A stereo pair and its disparity.
        image = image[0]
    image = np.asarray(image, dtype=np.float32) / 255
    return np.repeat(image[..., None], 3, axis=2) if image.ndim == 2 else image


@functools.cache
def photograph_detail(name):
    """Detail [h, w] of a photograph: its brightness without slow variation."""
    grey = photograph(name).mean(axis=2)
    detail = grey - cv2.GaussianBlur(grey, (0, 0), 24)
    return detail / detail.std()


def crop(photo, *, size, scale, rng, turn=np.pi, shear=0.25):
    """Random rotated, sheared crop (width, height) = size of a photo.

    scale: crop texels per photo pixel; turn: the largest rotation in radians.
    """
    angle = rng.uniform(-turn, turn)
    c, s = np.cos(angle) / scale, np.sin(angle) / scale
    linear = np.array([[c, -s], [s, c]])
    linear = linear @ np.array([[1.0, rng.uniform(-shear, shear)], [0.0, 1.0]])
    # The crop stays on the photo where it fits, else both centres meet.
    reach = np.abs(linear @ np.diag(size)).sum(axis=1) / 2
    extent = np.array(photo.shape[1::-1])
    margin = np.minimum(reach, extent / 2)
    offset = rng.uniform(margin, extent - margin) - linear @ np.array(size) / 2
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    matrix = np.column_stack([linear, offset])
    return cv2.warpAffine(
        photo, matrix, size, flags=flags, borderMode=cv2.BORDER_REFLECT_101
    )


def noise(shape, cell, rng):
    """Smooth noise [h, w] of about unit variance, its grains `cell` texels wide."""
    h, w = shape
    grid = rng.standard_normal((int(h / cell) + 3, int(w / cell) + 3), np.float32)
    size = (round(grid.shape[1] * cell), round(grid.shape[0] * cell))
    return 1.4 * cv2.resize(grid, size, interpolation=cv2.INTER_CUBIC)[:h, :w]


def fractal(shape, cell, rng, *, octaves=4):
    """Sum of noises [h, w] of halving cell and amplitude, about unit variance."""
    max_resolution = max(cell / 2 ** (octaves - 1), 1.0)
    # Coarse grains need few texels: the sum is made small, then enlarged.
    shrink = max(max_resolution / 2, 1.0)
    small = tuple(int(np.ceil(n / shrink)) + 1 for n in shape)
    total = np.zeros(small, np.float32)
    for k in range(octaves):
        total += 0.5**k * noise(small, max(cell / shrink / 2**k, 1.0), rng)
    total /= np.sqrt(sum(0.25**k for k in range(octaves)))
    if shrink > 1:
        size = (round(small[1] * shrink), round(small[0] * shrink))
        total = cv2.resize(total, size, interpolation=cv2.INTER_CUBIC)
    return total[: shape[0], : shape[1]]


def quilt(name, shape, rng, *, scale=0.6, patch=144):
    """Detail [h, w] of blended random crops of one photograph, and a little noise.

    scale: texels per photo pixel, times 0.8 to 1.25 from crop to crop. Weights are
    divided by the root of their squares' sum, not by their sum, so that contrast is
    the same in the middle of a crop and where several overlap.
    """
    h, w = shape
    source = photograph_detail(name)
    if scale != 1:
        source = cv2.resize(
            source, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA
        )
    ramp = np.sin(np.pi * (np.arange(patch, dtype=np.float32) + 0.5) / patch) ** 2
    window = np.outer(ramp, ramp)
    step = 2 * patch // 3
    total = np.zeros((h + 2 * patch, w + 2 * patch), np.float32)
    energy = np.full_like(total, 1e-6)
    for y in range(0, h + step, step):
        for x in range(0, w + step, step):
            photo = source[:, ::-1] if rng.random() < 0.5 else source
            size = (patch, patch)
            piece = crop(photo, size=size, scale=rng.uniform(0.8, 1.25), rng=rng)
            total[y : y + patch, x : x + patch] += window * piece
            energy[y : y + patch, x : x + patch] += window**2
    inside = slice(step, step + h), slice(step, step + w)
    detail = total[inside] / np.sqrt(energy[inside])
    return detail / detail.std() + 0.3 * noise(shape, 3, rng)


def tint(value, dark, light):
    """Colours [h, w, 3] from dark at value 0 over light at 1 to what lies at 1.2.

    Values outside 0..1.2 are cut off.
    """
    matrix = np.column_stack([np.subtract(light, dark), dark]).astype(np.float32)
    return cv2.transform(np.clip(value, 0, 1.2, dtype=np.float32), matrix)


def to_bytes(colour):
    """Texture [h, w, 3] uint8 of colours in 0..1."""
    return np.clip(colour * 255 + 0.5, 0, 255).astype(np.uint8)


def pyramid(texture):
    """The texture and its halvings, finest first."""
    levels = [texture]
    while min(levels[-1].shape[:2]) > 2:
        h, w = levels[-1].shape[:2]
        half = (max(w // 2, 1), max(h // 2, 1))
        levels.append(cv2.resize(levels[-1], half, interpolation=cv2.INTER_AREA))
    return levels


def flecks(texture, count, radius, colours, rng):
    """Draw `count` small ellipses (petals, leaves, chips) on a texture, in place."""
    h, w = texture.shape[:2]
    places = rng.uniform(0, 16 * np.array([w, h]), size=(count, 2)).astype(int)
    radii = rng.uniform(*radius, size=(count, 1)) * rng.uniform(0.4, 1, (count, 2))
    turns = rng.uniform(0, 180, size=count)
    picks = rng.integers(len(colours), size=count)
    gains = rng.uniform(0.75, 1.15, size=count)
    for place, radius_pair, turn, pick, gain in zip(
        places, radii, turns, picks, gains, strict=True
    ):
        axes = tuple(int(16 * r) for r in radius_pair)
        colour = np.clip(255 * gain * np.array(colours[pick]), 0, 255).tolist()
        # Coordinates in 1/16 texel, edges anti-aliased.
        cv2.ellipse(
            texture, place.tolist(), axes, turn, 0, 360, colour, -1, cv2.LINE_AA, 4
        )
