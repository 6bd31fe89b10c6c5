"""Pose error: the distance of cameras from the true ones, in pixels.

A frame cannot be seen in photos: before cameras are compared, one similarity brings the
true ones as near to the others as it can, at points that the views see.
"""

from types import SimpleNamespace

import numpy as np
from scipy.spatial.transform import Rotation

from alignerf.files import archives
from alignerf.scenes import cameras, prepared
from alignerf.sfm import similarity

# Places along each side of an image at which two cameras are compared.
GRID = 16


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
    return float(np.median([*similarity.distance_px(own, others, points).values()]))


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
