"""How far apart photos are, by the angles from which they see what held-out ones see.

A shape is fixed where three photos see it from near one another; two are matched by
chance, and a model that has seen a surface from far aside does not know how it looks.
"""

import math

import numpy as np

from alignerf.cameras.exposure import DEPTH_AGREES, Sampled, landed

# The photo of those that see a point whose angle counts, the nearest first.
SEEN_BY = 3
# So many held-out photos tell, and points of each.
MAX_VIEWS, MAX_POINTS = 16, 400


def degrees(held_out: list[Sampled], learnt: list[Sampled]):
    """Median angle between a held-out photo's ray and that of the third nearest photo.

    Of those learnt from that see its point; inf where fewer do for most points, NaN
    where nothing is known.
    """
    places = np.linspace(0, len(held_out) - 1, min(MAX_VIEWS, len(held_out)))
    chosen = [held_out[place] for place in places.round().astype(int)]
    found = np.concatenate([np.zeros(0), *(third(one, learnt) for one in chosen)])
    return float(np.median(found)) if len(found) else math.nan


def third(view: Sampled, learnt):
    """The angle in degrees [n] of each point of a view, inf where too few see it."""
    points = view.points[:: -(-len(view.points) // MAX_POINTS) or 1]
    angles = np.full((max(len(learnt), SEEN_BY), len(points)), np.inf)
    own = unit(points - view.camtoworld[:, 3])
    for row, other in zip(angles, learnt, strict=False):
        inside, at, depth = landed(points, other)
        off = np.abs(other.depth[at] - depth)
        seen = np.flatnonzero(inside)[off < 2 * DEPTH_AGREES * depth]
        cosine = (own[seen] * unit(points[seen] - other.camtoworld[:, 3])).sum(axis=-1)
        row[seen] = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    return np.partition(angles, SEEN_BY - 1, axis=0)[SEEN_BY - 1]


def unit(vectors):
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
