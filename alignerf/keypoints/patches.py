"""Patches of photos, and their alignment by translation with gain and offset.

Inverse compositional steps (Baker and Matthews 2004) towards the largest weighted zero-
mean normalised cross-correlation. Notation: o patches, k = SIDE ** 2 places of a
template, offsets from its middle in px of the reference.
"""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from alignerf.keypoints.tracks import first_of_each, inverted

# Templates are so many px wide, and of each view so many are kept: as much as a
# template of 1.5 times the size covers, 4 px off.
RADIUS = 8
REACH = 17
SIDE, KEPT = 2 * RADIUS + 1, 2 * REACH + 1
# Of a Gaussian window, in radii.
WINDOW = 0.6
# Steps at most, and of one in px; smaller ones end it.
STEPS, MAX_STEP_PX, MIN_STEP_PX = 12, 1.0, 0.003
# Flat patches have no more than noise, in grey levels.
NOISE = 1.0
# Of what is left between two normalised patches: none are alike to the bit.
MIN_VARIANCE = 0.003
COLUMNS = 64
# Of a surface's slope: 45 degrees are usual. It is the noise of a place, by how many
# places are independent.
PRIOR = 0.003
# Of a slope, a step at most.
MAX_BEND = 0.5
# Patches that correlate less are not those of one place yet.
MIN_SURE = 0.5

_steps = np.arange(-RADIUS, RADIUS + 1, dtype=np.float32)
OFFSETS = np.stack(np.meshgrid(_steps, _steps), axis=-1).reshape(-1, 2)
WEIGHTS = np.exp(-(OFFSETS**2).sum(axis=1) / (2 * (WINDOW * RADIUS) ** 2))
WEIGHTS = (WEIGHTS / WEIGHTS.sum()).astype(np.float32)
# As many places of equal weight tell as much.
EFFECTIVE = float(1 / (WEIGHTS**2).sum())


class Patches(NamedTuple):
    """Squares of photos around places; `corners` [o, 2] are their first pixels."""

    pixels: UInt8[np.ndarray, "o kept kept"]
    corners: Float[np.ndarray, "o 2"]

    def take(self, chosen):
        return Patches(self.pixels[chosen], self.corners[chosen])


def cut(grey, places) -> Patches:
    """The Patches [o] of a photo [h, w] around places [o, 2], pixel centres at +0.5.

    Beyond the photo its last pixels go on.
    """
    corners = np.floor(places).astype(int) - REACH
    height, width = grey.shape
    side = np.arange(KEPT)
    rows = np.clip(corners[:, 1, None] + side, 0, height - 1)
    columns = np.clip(corners[:, 0, None] + side, 0, width - 1)
    pixels = grey[rows[:, :, None], columns[:, None, :]]
    return Patches(pixels, corners.astype(np.float64))


class Atlas:
    """Patches beside each other in one image, that OpenCV samples at once."""

    def __init__(self, patches: Patches):
        count = len(patches.pixels)
        rows = max(1, -(-count // COLUMNS))
        tiles = np.zeros((rows * COLUMNS, KEPT, KEPT), np.float32)
        tiles[:count] = patches.pixels
        tiles = tiles.reshape(rows, COLUMNS, KEPT, KEPT).swapaxes(1, 2)
        self.image = tiles.reshape(rows * KEPT, COLUMNS * KEPT)
        number = np.arange(count)
        at = np.stack([number % COLUMNS, number // COLUMNS], axis=1) * KEPT
        # Of a place in a photo: its own in the image, whose pixels count from 0.
        self.move = at - patches.corners - 0.5
        self.at = at

    def sample(self, chosen, places, affine):
        """(values [o, k], [o] whether all are there) around places [o, 2] of photos.

        chosen [o]: whose patch; affine [o, 2, 2]: from OFFSETS to offsets of its photo.
        """
        middle = places + self.move[chosen]
        inside = np.isfinite(middle).all(axis=1) & np.isfinite(affine).all(axis=(1, 2))
        middle[~inside], affine = REACH, np.where(inside[:, None, None], affine, 0)
        first, last = self.at[chosen], self.at[chosen] + KEPT - 1.0
        maps = []
        for i in (0, 1):
            one = affine[:, i].astype(np.float32) @ OFFSETS.T
            one += middle[:, i, None].astype(np.float32)
            low, high = first[:, i], last[:, i]
            inside &= (one.min(axis=1) >= low) & (one.max(axis=1) <= high)
            maps.append(one)
        # What is beyond a patch belongs to another: it is not used. Linear: OpenCV's
        # cubic kernel (a = -0.75) misplaces patches by 0.06 px, this one by 0.015.
        return cv2.remap(self.image, *maps, cv2.INTER_LINEAR), inside


def normalised(values):
    """Values [o, k] of weighted mean 0 and variance 1."""
    values = values - (values @ WEIGHTS)[:, None]
    spread = np.sqrt(np.einsum("ok,ok,k->o", values, values, WEIGHTS) + NOISE**2)
    values /= spread[:, None]
    return values


def jacobian(values):
    """[o, 2, k] of normalised patches [o, k] by px of the template.

    What gain and offset explain is no motion.
    """
    square = values.reshape(-1, SIDE, SIDE)
    dy, dx = np.gradient(square, axis=(1, 2))
    found = np.stack([dx, dy], axis=1).reshape(len(values), 2, -1)
    return without_gain(found, values)


def without_gain(columns, values):
    """Columns [o, c, k] without their share of a constant and of the values [o, k]."""
    columns = columns - (columns @ WEIGHTS)[..., None]
    share = np.einsum("ock,ok->oc", columns, values * WEIGHTS)
    columns -= share[..., None] * values[:, None]
    return columns


class Aligned(NamedTuple):
    """places [o, 2]; correlation [o] of -1 to 1; deviation_px [o], as it is expected.

    slopes [t, 2] of the tracks' surfaces.
    """

    places: Float[np.ndarray, "o 2"]
    correlation: Float[np.ndarray, " o"]
    deviation_px: Float[np.ndarray, " o"]
    slopes: Float[np.ndarray, "t 2"]


def align(templates, atlas, places, warps, track, *, fits_slopes):
    """`Aligned` places of templates [o, k] in an atlas of o patches.

    places [o, 2]: first guesses; warps: `tracks.Warps` of the o patches; track [o]:
    sorted numbers from 0, whose surfaces' slopes are refined where `fits_slopes`.
    """
    wanted = normalised(templates)
    columns = jacobian(wanted)
    slopes = np.zeros((track.max(initial=-1) + 1, 2))
    if fits_slopes:
        along = np.einsum("oij,oj->oi", inverted(warps.affine), warps.slope)
        # A warp that is not finite is sampled nowhere.
        along = np.where(np.isfinite(along), along, 0).astype(np.float32)
        towards = np.einsum("ock,oc->ok", columns, along)
        bending = without_gain(towards[:, None] * OFFSETS.T, wanted)
        columns = np.concatenate([columns, bending], axis=1)
    weighted = columns * WEIGHTS
    matrix = (weighted @ columns.swapaxes(1, 2)).astype(float)
    matrix[:, :2, :2] += 1e-6 * np.eye(2)
    inverse = np.linalg.inv(matrix[:, :2, :2])
    places = places.copy()
    correlation = np.full(len(places), -1.0)
    variance = np.full(len(places), np.inf)
    chosen = np.arange(len(places))
    for _ in range(STEPS):
        of = track[chosen]
        bent = warps.take(chosen).bent(slopes[of])
        values, inside = atlas.sample(chosen, places[chosen], bent)
        rest = wanted[chosen] - normalised(values)
        variance[chosen] = np.einsum("ok,ok,k->o", rest, rest, WEIGHTS)
        correlation[chosen] = np.where(inside, 1 - variance[chosen] / 2, -1)
        vector = np.einsum("ock,ok->oc", weighted[chosen], rest).astype(float)
        sure = correlation[chosen] > MIN_SURE
        if fits_slopes:
            bend = bending_of(matrix[chosen], inverse[chosen], vector, sure, of, slopes)
            slopes[of[first_of_each(of)]] += bend
            own = bend[np.cumsum(np.diff(of, prepend=-1) != 0) - 1]
            vector[:, :2] -= np.einsum("oij,oj->oi", matrix[chosen, :2, 2:], own)
        move = np.einsum("oij,oj->oi", inverse[chosen], vector[:, :2])
        length = np.linalg.norm(move, axis=1, keepdims=True)
        move *= np.minimum(1, MAX_STEP_PX / np.maximum(length, 1e-9))
        move = np.einsum("oij,oj->oi", bent, move)
        places[chosen] += np.where(inside[:, None], move, 0)
        moves = inside & (length[:, 0] > MIN_STEP_PX)
        if fits_slopes:
            # A track is done with as a whole.
            moves = np.bincount(of, moves & sure, minlength=len(slopes))[of] > 0
        chosen = chosen[moves]
        if not len(chosen):
            break
    # Of an edge it is 0, or less by rounding.
    least = np.maximum(np.linalg.eigvalsh(matrix[:, :2, :2])[:, 0], 1e-6)
    deviation = np.sqrt((variance + MIN_VARIANCE) / (EFFECTIVE * least))
    return Aligned(places, correlation, deviation, slopes)


def bending_of(matrix, inverse, vector, sure, of, slopes):
    """[u, 2] by how much the slopes of the u tracks `of` [o] change in one step.

    matrix [o, 4, 4], vector [o, 4]: normal equations of place and slope; inverse
    [o, 2, 2]: of the place's part, which is eliminated. Patches that are not `sure` [o]
    have no say.
    """
    starts = first_of_each(of)
    across = matrix[:, 2:, :2] @ inverse
    own = (matrix[:, 2:, 2:] - across @ matrix[:, :2, 2:]) * sure[:, None, None]
    right = vector[:, 2:] - np.einsum("oij,oj->oi", across, vector[:, :2])
    own = np.add.reduceat(own, starts) + PRIOR * np.eye(2)
    right = np.add.reduceat(right * sure[:, None], starts)
    right -= PRIOR * slopes[of[starts]]
    bend = np.linalg.solve(own, right[..., None])[..., 0]
    return np.clip(bend, -MAX_BEND, MAX_BEND)
