"""What all views' flows share: faults of the lens, not of poses or motion.

A camera that is off differs from view to view; a principal point or a distortion that
is wrong is the same in all. Notation: flows [n, h, w, 2] from renders to photos, NaN
where not valid; pixels x, y from the image's middle, in units of half its diagonal.
"""

from typing import NamedTuple

import numpy as np

# Pixels beyond these quantiles of their view's lengths are left out: what moves.
MAX_LENGTH = 0.9
# Places a side at which flows are averaged.
GRID = 24


class Pattern(NamedTuple):
    """The lens's common part, in px: at the image's corner where it grows outwards."""

    shift_px: tuple[float, float]
    # Standard errors of these over views.
    shift_error_px: tuple[float, float]
    # r^3: a wrong distortion. What grows with r is a zoom, and is taken off.
    distortion_px: float
    distortion_error_px: float


def of_flows(flows):
    """The pattern of the training views' flows; NaN errors for fewer than 3 views.

    Views without a valid flow are left out, unless all are such.
    """
    known = [flow for flow in flows if np.isfinite(flow).any()]
    fits = np.stack([fit(flow) for flow in known or flows])
    mean = fits.mean(axis=0)
    error = np.full(len(mean), np.nan)
    if len(fits) > 2:
        error = fits.std(axis=0, ddof=1) / np.sqrt(len(fits))
    return Pattern(
        shift_px=(float(mean[0]), float(mean[1])),
        shift_error_px=(float(error[0]), float(error[1])),
        distortion_px=float(mean[3]),
        distortion_error_px=float(error[3]),
    )


def fit(flow):
    """[shift x, shift y, zoom, distortion] in px of one flow [h, w, 2].

    Least squares on what is left of a regular sample without its longest vectors.
    """
    height, width = flow.shape[:2]
    rows = np.linspace(0, height - 1, min(GRID, height)).astype(int)
    columns = np.linspace(0, width - 1, min(GRID, width)).astype(int)
    y, x = np.meshgrid(rows, columns, indexing="ij")
    vectors = flow[y, x].reshape(-1, 2).astype(np.float64)
    half = np.hypot(width, height) / 2
    at = np.stack([x.ravel() + 0.5 - width / 2, y.ravel() + 0.5 - height / 2], -1)
    at = at / half
    length = np.linalg.norm(vectors, axis=-1)
    known = np.isfinite(length)
    if known.sum() < 8:
        return np.zeros(4)
    known &= length <= np.quantile(length[known], MAX_LENGTH)
    at, vectors = at[known], vectors[known]
    square = (at**2).sum(axis=-1, keepdims=True)
    columns = [np.tile([1.0, 0.0], (len(at), 1)), np.tile([0.0, 1.0], (len(at), 1))]
    columns += [at, at * square]
    matrix = np.stack(columns, axis=-1).reshape(-1, 4)
    coefficients, *_ = np.linalg.lstsq(matrix, vectors.ravel(), rcond=None)
    return coefficients
