"""The similarity between two sets of cameras of the same views, by what they see.

A similarity of centres and axes lets the frame turn against what the cameras see:
where all cameras are right to 0.17 px it says 1.3 px and more. Here it is the one that
makes the distance in px least at the points that the views see.
"""

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from alignerf.scenes import cameras

# Points of a view that are enough.
MAX_POINTS = 60
# A residual beyond it is as large.
FAR_PX = 1e6


def fit(target, source, points):
    """(scale, rotation [3, 3], translation [3]) from source's world to target's.

    target, source: cameras of the same views, with `camtopix` and `camtoworlds`.
    points: {view: [k, 3]} in source's world, of the views that count.
    """
    views = sorted(points)
    start = cameras.align_similarity(
        source.camtoworlds[views], target.camtoworlds[views]
    )
    each = {v: points[v][:: max(1, len(points[v]) // MAX_POINTS)] for v in views}
    xyz = np.concatenate([each[v] for v in views])
    view = np.repeat(views, [len(each[v]) for v in views])
    seen = project(source, view, xyz)
    # In units of the scene, so that all seven numbers are of one size.
    middle, extent = xyz.mean(axis=0), np.abs(xyz - xyz.mean(axis=0)).max() or 1.0
    scale, turn, shift = start

    def similarity_of(x):
        own = scale * np.exp(x[0])
        own_turn = Rotation.from_rotvec(x[1:4]).as_matrix() @ turn
        moved = scale * turn @ middle + shift + x[4:] * scale * extent
        return own, own_turn, moved - own * own_turn @ middle

    def residuals(x):
        own, own_turn, moved = similarity_of(x)
        with np.errstate(all="ignore"):
            off = project(target, view, own * xyz @ own_turn.T + moved) - seen
        # What lies in a camera's plane has no image, and is far from any.
        return np.where(np.abs(off) < FAR_PX, off, FAR_PX).ravel()

    best = least_squares(residuals, np.zeros(7), loss="soft_l1", max_nfev=50).x
    return similarity_of(best)


def project(of, view, points):
    """Px [k, 2] at which each point [k, 3] is seen by the camera of its view [k]."""
    turns = of.camtoworlds[:, :, :3] @ cameras.OPENGL_FROM_OPENCV
    from_centre = points - of.camtoworlds[view, :, 3]
    seen = np.einsum("kji,kj->ki", turns[view], from_centre)
    pixels = np.einsum("kij,kj->ki", of.camtopix[view], seen)
    return pixels[:, :2] / pixels[:, 2:]


def distance_px(target, source, points):
    """{view: median distance in px} of what two sets of cameras see, at their best.

    Arguments as of `fit`: the pose error of `source`, where `target` is the truth.
    """
    scale, turn, shift = fit(target, source, points)
    found = {}
    for view, xyz in points.items():
        at = np.full(len(xyz), view)
        moved = scale * xyz @ turn.T + shift
        off = project(target, at, moved) - project(source, at, xyz)
        found[view] = float(np.median(np.linalg.norm(off, axis=-1)))
    return found
