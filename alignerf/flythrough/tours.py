"""In what order cameras are visited: a short way past all of them.

Notation: poses [n, 3, 4] camera-to-world; distances [n, n] in units of the frame, with
HALF_TURN of them for a camera that looks the other way.
"""

import numpy as np

# Beyond these, every so many-th camera is visited: a way among them is as smooth.
MOST_CAMERAS = 200
# In a frame where the largest coordinate is 1.
HALF_TURN = 1.5


def order(poses):
    """Indices of cameras along a short open way, at most MOST_CAMERAS of them.

    It begins with the shorter of two ways, in the order of the views or from each
    camera to its nearest, and turns stretches of it round while that shortens it
    (2-opt, Croes 1958). Photos that were taken in a row so stay in that row.
    """
    chosen = np.arange(len(poses))
    if len(poses) > MOST_CAMERAS:
        steps = np.linspace(0, len(poses) - 1, MOST_CAMERAS)
        chosen = np.unique(np.round(steps).astype(int))
    distances = between(poses[chosen])
    first = int(distances.sum(axis=0).argmax())
    ways = [np.arange(len(chosen)), nearest(distances, first)]
    way = min(ways, key=lambda one: length(distances, one))
    return chosen[shortened(distances, way)]


def between(poses):
    """Distances of cameras, by their places and by the angles between them."""
    centres = poses[:, :, 3]
    apart = np.linalg.norm(centres[:, None] - centres[None], axis=-1)
    return apart + HALF_TURN * angles(poses, poses) / np.pi


def angles(poses, others):
    """Angles [n, m] in radians between the turns of poses [n, 3, 4] and [m, 3, 4]."""
    traces = np.einsum("aij,bij->ab", poses[:, :, :3], others[:, :, :3])
    return np.arccos(np.clip((traces - 1) / 2, -1.0, 1.0))


def length(distances, way):
    """Length of an open way."""
    return float(distances[way[:-1], way[1:]].sum())


def nearest(distances, first):
    """The way that goes on to the nearest camera that it has not visited."""
    way, left = [first], np.ones(len(distances), bool)
    left[first] = False
    while left.any():
        row = np.where(left, distances[way[-1]], np.inf)
        way.append(int(row.argmin()))
        left[way[-1]] = False
    return np.array(way)


def shortened(distances, way):
    """A way with no stretch that would make it shorter if it were turned round."""
    count = len(way)
    first, last = np.triu_indices(count, 1)
    for _ in range(10 * count):
        # What stands before the first camera, and behind the last, is at no distance.
        along = np.zeros((count + 2, count + 2))
        along[1:-1, 1:-1] = distances[np.ix_(way, way)]
        i, j = first + 1, last + 1
        gain = along[i - 1, i] + along[j, j + 1] - along[i - 1, j] - along[i, j + 1]
        best = int(gain.argmax()) if count > 1 else 0
        if count < 2 or gain[best] < 1e-9:
            break
        stretch = slice(first[best], last[best] + 1)
        way = way.copy()
        way[stretch] = way[stretch][::-1]
    return way
