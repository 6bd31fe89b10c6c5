"""Cameras by their formulas in float64: slow twins of poses, rays and lenses.

Notation: poses [n, 3, 4] with OpenGL axes, pixtocam [..., 3, 3] inverse intrinsics of
pixels whose centres are at +1/2.
"""

import numpy as np


def normalised_poses(poses):
    """Both PCA frames of poses [n, 3, 4] by singular vectors [2, n, 3, 4].

    Right-handed, the cameras' mean up has z >= 0, max |t| = 1: what is left open is
    a half turn about z.
    """
    centres = poses[:, :, 3] - poses[:, :, 3].mean(axis=0)
    axes = np.linalg.svd(centres)[2]
    up = np.sign((poses[:, :, 1] @ axes[2]).mean())
    found = []
    for sign in (1, -1):
        x, z = sign * axes[0], up * axes[2]
        frame = np.stack([x, np.cross(z, x), z])
        moved = centres @ frame.T
        rotations = np.stack([frame @ pose[:, :3] for pose in poses])
        moved = moved / np.abs(moved).max()
        found.append(np.concatenate([rotations, moved[..., None]], axis=-1))
    return np.stack(found)


def pixel_ray(x, y, pixtocam, pose):
    """Direction through (x + 1/2, y + 1/2) of an OpenGL camera [..., 3]."""
    pixel = np.stack([x + 0.5, y + 0.5, np.ones_like(x + 0.5)], axis=-1)
    opencv = (pixtocam * pixel[..., None, :]).sum(axis=-1)
    opengl = opencv * [1, -1, -1]
    return (pose[..., :3] * opengl[..., None, :]).sum(axis=-1)


def ray_radius(x, y, pixtocam, pose):
    """2 / sqrt(12) of the mean distance to the x and y neighbours' directions."""
    here = pixel_ray(x, y, pixtocam, pose)
    right = np.linalg.norm(pixel_ray(x + 1, y, pixtocam, pose) - here, axis=-1)
    below = np.linalg.norm(pixel_ray(x, y + 1, pixtocam, pose) - here, axis=-1)
    return (right + below) / 2 * 2 / np.sqrt(12)


def reprojection_flow(depth, camera, other):
    """By how much [h, w, 2] another camera sees the points of a depth map aside.

    camera, other: (pixtocam, pose); depth [h, w] along the first one's optical axis.
    """
    y, x = np.indices(depth.shape)
    points = camera[1][:, 3] + depth[..., None] * pixel_ray(x, y, *camera)
    seen = (points - other[1][:, 3]) @ other[1][:, :3] * [1, -1, -1]
    pixel = seen @ np.linalg.inv(other[0]).T
    assert (pixel[..., 2] > 0).all()
    pixel = pixel[..., :2] / pixel[..., 2:]
    return pixel - np.stack([x + 0.5, y + 0.5], axis=-1)


def distorted(x, y, k1, k2, p1, p2, k3):
    """OpenCV's polynomial model of a lens, normalised coordinates."""
    r = np.hypot(x, y)
    radial = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
    dx = 2 * p1 * x * y + p2 * (r**2 + 2 * x**2)
    dy = p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y
    return x * radial + dx, y * radial + dy


def wall(points):
    """Colours [..., 3] of a smooth pattern on a far wall, at points [..., 2] of it."""
    x, y = points[..., 0], points[..., 1]
    waves = np.sin(5 * x + 2), np.sin(4 * y + x), np.cos(4 * (x - y))
    return np.stack(waves, axis=-1) * 100 + 128


def pixel_centres(width, height):
    """[height * width, 2], row by row."""
    grid = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack(grid, axis=-1).reshape(-1, 2)
