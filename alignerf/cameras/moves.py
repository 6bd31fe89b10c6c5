"""What all moves of cameras have in common.

Photos do not show a similarity of the whole world. So cameras that were moved by
photos, corrected or learnt, may all have moved alike. Held-out cameras stay, and would
see the scene elsewhere. `in_common` is the similarity by which all have moved.

Moves are not equally sure. Through a long lens a turn and a step sideways look alike:
how much of either a camera got is mostly chance, only the sum is sure. Flow may even
turn all cameras together, and step them back. A fit that weighs turns and steps alike
(`scenes.cameras.align_similarity`) then leaves half of that turn. Here the moves
themselves tell how sure they are, by their covariance over the cameras (generalised
least squares, Aitken 1936). Where cameras only turn, their centres hold the frame;
where turns and steps go together, only the sum of both counts.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras

# The fit and the covariance depend on each other. Hardly anything changes after a few
# times.
TIMES = 5
# Few cameras do not show a covariance: it is mixed with that of independent moves, as
# of so many cameras.
INDEPENDENT = 6
# The surest direction has at least this standard deviation, in those of the mean one.
MIN_SIGMA = 1e-3
# Moves shorter than that, in radians and radii of the capture, are rounding.
ROUNDING = 1e-12
# A fit whose single change is larger, in radians or as a logarithm, runs away.
MAX_CHANGE = 1.0


def in_common(source, target):
    """(scale, rotation [3, 3], translation [3]) that takes source to target.

    source, target: poses [n, 3, 4] of the same cameras, before and after they moved, or
    the other way round. Where the centres of either are one place the scale is 1.
    Raises ValueError where a pose is not finite.
    """
    start = found = cameras.align_similarity(source, target)
    sizes = not (cameras.is_one_place(source) or cameras.is_one_place(target))
    for _ in range(TIMES):
        now = cameras.apply_similarity(source, *found)
        moves, middle, radius = between(now, target, sizes)
        if np.abs(moves).max() < ROUNDING:
            break
        whiten = np.linalg.cholesky(np.linalg.inv(covariance(moves))).T
        by = derivative((now[:, :, 3] - middle) / radius, target)
        by[:, :, 6] *= sizes
        change, *_ = np.linalg.lstsq(
            (whiten @ by).reshape(-1, 7), (moves @ whiten.T).ravel(), rcond=1e-9
        )
        if not np.abs(change[[0, 1, 2, 6]]).max() < MAX_CHANGE:
            return start
        found = followed(found, change, middle, radius)
    return found


def between(source, target, sizes):
    """(moves [n, 6], their middle [3], radius): turns and steps from source to target.

    Along the axes of the target's cameras, in radians and in radii of its centres; in
    units of the world where it has no size.
    """
    axes = target[:, :, :3]
    turns = Rotation.from_matrix(source[:, :, :3].swapaxes(1, 2) @ axes).as_rotvec()
    centres, middle = source[:, :, 3], source[:, :, 3].mean(axis=0)
    away = target[:, :, 3] - target[:, :, 3].mean(axis=0)
    radius = np.sqrt((away**2).sum(axis=-1).mean()) if sizes else 1.0
    steps = np.einsum("nji,nj->ni", axes, target[:, :, 3] - centres) / radius
    return np.concatenate([turns, steps], axis=1), middle, radius


def covariance(moves):
    """Covariance [6, 6] of moves [n, 6] about 0, positive definite."""
    squares = (moves**2).mean(axis=0)
    independent = np.diag(np.repeat([squares[:3].mean(), squares[3:].mean()], 3))
    found = moves.T @ moves + INDEPENDENT * independent
    least = MIN_SIGMA**2 * squares.mean()
    return found / (len(moves) + INDEPENDENT) + least * np.eye(6)


def derivative(centres, target):
    """Derivative [n, 6, 7] of moves by a turn, a shift and a scale of the world.

    About the middle, from which centres [n, 3] are counted, in radii.
    """
    back = target[:, :, :3].swapaxes(1, 2)
    by = np.zeros((len(centres), 6, 7))
    by[:, :3, :3] = by[:, 3:, 3:6] = back
    # w x c, as a matrix times w.
    by[:, 3:, :3] = back @ np.cross(np.eye(3), centres[:, None]).swapaxes(1, 2)
    by[:, 3:, 6] = np.einsum("nij,nj->ni", back, centres)
    return by


def followed(found, change, middle, radius):
    """A similarity, and after it a change [7] as of `derivative`."""
    scale, turn, shift = found
    more = Rotation.from_rotvec(change[:3]).as_matrix()
    larger = np.exp(change[6])
    moved = larger * more @ (shift - middle) + middle + radius * change[3:6]
    return scale * larger, more @ turn, moved
