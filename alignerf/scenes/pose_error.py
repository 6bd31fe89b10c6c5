"""Pose error: the distance of cameras from the true ones, in pixels.

A frame cannot be seen in photos: before cameras are compared, one similarity aligns the
true cameras to the others.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from alignerf.files import archives
from alignerf.scenes import cameras, prepared

# Places along each side of an image at which two cameras are compared.
GRID = 16


def median_px(state: prepared.Scene, true, views, depths):
    """Median over views of the distance between a camera and its true one, in px.

    true: arrays as of `prepared.read_cameras`, of the same views; depths [views] in
    units of the state's frame, at which the cameras are compared.
    """
    similarity = cameras.align_similarity(
        true["camtoworlds"][views], state.camtoworlds[views]
    )
    poses = cameras.apply_similarity(true["camtoworlds"], *similarity)
    size = state.width, state.height
    errors = [
        length_px(
            (state.pixtocams[view], state.camtoworlds[view]),
            (true["pixtocams"][view], poses[view]),
            size,
            depth,
        )
        for view, depth in zip(views, depths, strict=True)
    ]
    return float(np.median(errors))


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


def true_depths(state: prepared.Scene, truth, views):
    """Median depth [views] that the oracle's views have, in the scene's frame."""
    original = prepared.read_cameras(state.folder / "cameras.npz")["camtoworlds"]
    scale = cameras.frame_of(original).scale
    paths = [f"{truth}/depth/{state.names[view]}.npz" for view in views]
    depths = [archives.read(path, ["depth_m"])["depth_m"] for path in paths]
    return [scale * float(np.median(depth_m)) for depth_m in depths]
