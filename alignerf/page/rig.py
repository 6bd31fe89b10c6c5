"""The cameras in space as the page draws them: frusta, corrections, points.

Notation: points [m, 3] and camtoworlds [n, 3, 4] in the scene's normalised frame; the
drawing's axes are x right, y up, z towards the viewer.
"""

import cv2
import numpy as np

from alignerf.io import archives
from alignerf.scenes import cameras, prepared

# Points that are drawn; the farthest from their middle, in medians, are not.
MAX_POINTS, FAR = 1500, 3.0
# Length of a frustum in distances to the nearest other camera, and of the scene.
OF_DISTANCE, OF_SCENE = 0.5, (0.05, 0.15)
# Corrections are enlarged until the longest of nine tenths has this share of the scene.
ARROW, TIMES = 0.15, (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)
DIGITS = 4
# Up, in an upright photo, of a photo that is turned clockwise to stand upright: axes
# of OpenGL.
UP = ([0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0])


def told(folder, turns, moved=None):
    """{names, splits, cameras, arrows, times, moving, points} of a prepared scene.

    turns: {view: quarter turns that make it upright}. moved: a cameras.npz with
    cameras that were corrected, or None. cameras [n, 5, 3]: centre, then the corners of
    the frustum; arrows: per camera [2, 3] from before to after, `times` enlarged, or
    None where it has not moved; points: {places [m, 3], colours [m, 3] of bytes}.
    """
    scene = prepared.load(folder)
    after = prepared.load(folder, moved) if moved else scene
    points, colours = points_of(scene)
    poses = scene.camtoworlds
    axes = axes_of(poses, [turns.get(name, 0) for name in scene.names])
    length = length_of(poses[:, :, 3])
    frusta = np.stack([frustum(scene, view, length) for view in range(len(poses))])
    ends, times = arrows(poses, after.camtoworlds, length)
    return {
        "names": scene.names,
        "splits": scene.split.tolist(),
        "cameras": drawn(frusta, axes),
        "arrows": [one if one is None else drawn(one, axes) for one in ends],
        "times": times,
        "moving": any(one is not None for one in ends),
        "points": {"places": drawn(points, axes), "colours": colours.tolist()},
    }


def drawn(places, axes):
    """Places [..., 3] along the drawing's axes [3, 3], in few digits."""
    return np.round(places @ axes.T, DIGITS).tolist()


def axes_of(poses, turns):
    """Axes [3, 3] of the drawing: up as in the photos, cameras looking away."""
    ups = np.stack(
        [pose[:, :3] @ UP[turn % 4] for pose, turn in zip(poses, turns, strict=True)]
    )
    up = unit(ups.mean(axis=0), [0.0, 0.0, 1.0])
    back = poses[:, :, 2].mean(axis=0)
    back = back - (back @ up) * up
    if np.linalg.norm(back) < 0.1:
        # They look everywhere: from the first one.
        back = poses[0, :, 2] - (poses[0, :, 2] @ up) * up
    other = np.eye(3)[np.argmin(np.abs(up))]
    back = unit(back, np.cross(up, other))
    return np.stack([np.cross(up, back), up, back])


def unit(vector, instead):
    """A vector at length 1; another one instead of none."""
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-6 else unit(np.asarray(instead, float), [1.0])


def length_of(centres):
    """Length of the frusta: so that neighbours do not hide each other."""
    away = np.linalg.norm(centres[:, None] - centres[None], axis=-1)
    np.fill_diagonal(away, np.inf)
    nearest = away.min(axis=1)
    usual = np.median(nearest) if len(centres) > 1 else 1.0
    return float(np.clip(OF_DISTANCE * usual, *OF_SCENE))


def frustum(scene, view, length):
    """Centre and four corners [5, 3] of a camera's frustum."""
    w, h = scene.width, scene.height
    corners = np.array([[0, 0, 1], [w, 0, 1], [w, h, 1], [0, h, 1]], float)
    rays = corners @ scene.pixtocams[view].T * [1, -1, -1]
    pose = scene.camtoworlds[view]
    return np.concatenate(
        [pose[None, :, 3], pose[:, 3] + length * rays @ pose[:, :3].T]
    )


def arrows(poses, after, length):
    """(per camera [2, 3], or None where it has not moved; how much enlarged).

    From the middle of a frustum's end to where it lies after the correction: a turn is
    seen there as well as a step.
    """
    tips = [pose[:, 3] - length * pose[:, 2] for pose in poses]
    steps = after[:, :, 3] - poses[:, :, 3]
    turns = [
        cv2.Rodrigues(b[:, :3] @ a[:, :3].T)[0][:, 0]
        for a, b in zip(poses, after, strict=True)
    ]
    sizes = np.linalg.norm(steps, axis=1) + length * np.linalg.norm(turns, axis=1)
    moved = sizes > 1e-7
    if not moved.any():
        return [None] * len(poses), 1
    longest = np.quantile(sizes[moved], 0.9)
    times = max([t for t in TIMES if t * longest <= ARROW], default=1)
    ends = []
    for i, pose in enumerate(poses):
        ahead = cv2.Rodrigues(times * turns[i])[0] @ (-length * pose[:, 2])
        end = pose[:, 3] + times * steps[i] + ahead
        ends.append(np.stack([tips[i], end]) if moved[i] else None)
    return ends, times


def points_of(scene):
    """(points [m, 3], colours [m, 3] uint8) of the scene that are drawn; maybe none."""
    path = scene.folder / prepared.POINTS
    if not path.is_file():
        return np.zeros((0, 3)), np.zeros((0, 3), np.uint8)
    data = archives.read(path, ("points", "colours"))
    given = prepared.read_cameras(scene.folder / "cameras.npz")["camtoworlds"]
    frame = cameras.frame_of(given).transform()
    points = data["points"] @ frame[:3, :3].T + frame[:3, 3]
    away = np.linalg.norm(points - np.median(points, axis=0), axis=1)
    near = np.flatnonzero(away <= FAR * np.median(away))
    near = near[:: max(-(-len(near) // MAX_POINTS), 1)]
    return points[near], data["colours"][near]
