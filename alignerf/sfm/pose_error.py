"""Pose error: the distance of cameras from the true ones, in pixels.

A frame cannot be seen in photos: before cameras are compared, one similarity brings the
true ones as near to the others as it can, at points that the views see. A similarity of
centres and axes lets the frame turn against what the cameras see: where all cameras are
right to 0.17 px it says 1.3 px and more.
"""

from types import SimpleNamespace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from alignerf.io import archives
from alignerf.scenes import cameras, prepared

# Points of a view that are enough for a similarity.
MAX_POINTS = 60
# A residual beyond it is as large.
FAR_PX = 1e6
# Places along each side of an image at which two cameras are compared.
GRID = 16


def fit(target, source, points):
    """(scale, rotation [3, 3], translation [3]) from source's world to target's.

    target, source: cameras of the same views, with `camtopix` and `camtoworlds`.
    points: {view: [k, 3]} in source's world, of the views that count.
    """
    views = sorted(points)
    start = similarity_of_most(source.camtoworlds[views], target.camtoworlds[views])
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

    # Views that are anywhere decide nothing, however far off what they see is.
    usual = max(float(np.median(np.abs(residuals(np.zeros(7))))), 1.0)
    options = {"loss": "cauchy", "f_scale": usual, "max_nfev": 50}
    best = least_squares(residuals, np.zeros(7), **options).x
    return similarity_of(best)


def similarity_of_most(source, target):
    """(scale, rotation [3, 3], translation [3]) that takes most of source's poses to
    target's, whatever the others are. Exact for poses that differ by a similarity.
    """
    turns = target[:, :, :3] @ source[:, :, :3].swapaxes(1, 2)
    agree = np.einsum("aij,bij->ab", turns, turns)
    turn = turns[np.argmax(np.median(agree, axis=1))]
    centres = source[:, :, 3], target[:, :, 3]
    lengths = [np.linalg.norm(one[:, None] - one, axis=-1) for one in centres]
    apart = (lengths[0] > 0) & (lengths[1] > 0)
    is_one_place = any(map(cameras.is_one_place, (source, target)))
    scale = 1.0
    if apart.any() and not is_one_place:
        scale = float(np.median(lengths[1][apart] / lengths[0][apart]))
    return scale, turn, np.median(centres[1] - scale * centres[0] @ turn.T, axis=0)


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


def median_px(state: prepared.Scene, true, points):
    """Median over views of the distance between what both cameras see, in px.

    true: arrays as of `prepared.read_cameras`, of the same views; points: {view:
    [k, 3]} in the frame of `true`, of the views that are compared.
    """
    own, others = (
        SimpleNamespace(camtopix=np.linalg.inv(pixtocams), camtoworlds=poses)
        for pixtocams, poses in (
            (state.pixtocams, state.camtoworlds),
            (true["pixtocams"], true["camtoworlds"]),
        )
    )
    return float(np.median([*distance_px(own, others, points).values()]))


def difference(camera, other, size, depth):
    """The difference of two cameras: {rotation_deg, centre, length_px}.

    centre in units of the frame; arguments as of `length_px`.
    """
    (_, pose), (_, moved) = camera, other
    turn = Rotation.from_matrix(pose[:, :3].T @ moved[:, :3]).as_rotvec()
    return {
        "rotation_deg": float(np.degrees(np.linalg.norm(turn))),
        "centre": float(np.linalg.norm(moved[:, 3] - pose[:, 3])),
        "length_px": length_px(camera, other, size, depth),
    }


def length_px(camera, other, size, depth):
    """Median over an image of the distance in px between two cameras' projections.

    camera, other: (pixtocam [3, 3], camtoworld [3, 4]); size: (width, height) in px;
    depth: of the points that are projected.
    """
    steps = [(np.arange(GRID) + 0.5) * side / GRID for side in size]
    pixels = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2)
    rays = cameras.pixels_to_rays(*(pixels.T - 0.5), *camera)
    seen, _ = cameras.project(rays.origins + depth * rays.directions, *other)
    return float(np.median(np.linalg.norm(seen - pixels, axis=-1)))


def true_points(state: prepared.Scene, truth, views):
    """{view: [k, 3]}: points that views see by the true depth, in the truth's frame."""
    given, found = prepared.read_cameras(state.folder / "cameras.npz"), {}
    for view in views:
        path = f"{truth}/depth/{state.names[view]}.npz"
        depth_m = archives.read(path, ["depth_m"])["depth_m"].astype(float)
        found[view] = points_of(given, view, depth_m)
    return found


def points_of(arrays, view, depth):
    """Points [k, 3] on a grid of a view's pixels, in the frame of its camera.

    arrays: of a cameras.npz; depth [h, w] along the optical axis; what is not known, or
    not in front, is left out.
    """
    height, width = depth.shape
    steps = [(np.arange(GRID) + 0.5) * side / GRID for side in (width, height)]
    x, y = np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 2).astype(int).T
    depth = depth[y, x]
    seen = np.isfinite(depth) & (depth > 0)
    camera = arrays["pixtocams"][view], arrays["camtoworlds"][view]
    rays = cameras.pixels_to_rays(x[seen], y[seen], *camera)
    return rays.origins + depth[seen, None] * rays.directions
