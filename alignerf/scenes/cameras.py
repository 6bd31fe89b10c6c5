"""Pinhole cameras and the rays that leave them.

Notation: `pixtocams` [n, 3, 3] inverse intrinsics, `camtoworlds` [n, 3, 4] poses
with OpenGL axes (x right, y up, z backwards); pixel (x, y) has its centre at
(x + 0.5, y + 0.5). Lengths are in units of the scene's frame, angles in radians,
`_px` in pixels. Functions work on NumPy and on JAX arrays alike.
"""

import logging
from typing import Any, NamedTuple

import numpy as np

from alignerf.io import faults

log = logging.getLogger(__name__)

# Of NumPy or of JAX, which most users of cameras need not wait for.
Array = Any

# Beyond it squares, as of distances between cameras, leave float32.
LARGEST = 1e18
# Of the width of a photo over its focal length: no lens sees less, or more.
FIELD = 1e-6, 1e6
# Of the principal point's distance to a photo's middle, in its widths.
MAX_OFF_CENTRE = 100
# Files print six digits; what is further from a rotation is scaled or mirrored.
ROTATION_ERROR = 1e-2
# By how much a rotation in a file may stretch lengths, and by how much without a word:
# four decimals do so.
STRETCH, ROUNDING = 0.05, 2e-4

# OpenCV axes (x right, y down, z forwards) from OpenGL axes, and back.
OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0])
# Centres within so much, and within so much of their distance from the origin, are one
# place: of shorter lengths squares, as of the cameras' spread, come to nothing.
ONE_PLACE = 1e-9
# Of the cameras' spread: axes that meet further away are as good as parallel.
MAX_FOCUS = 100


class Rays(NamedTuple):
    """Rays of any batch shape; what a cone needs to be cast.

    origins [..., 3]; directions [..., 3] unnormalised, of length 1 along the
    optical axis; viewdirs [..., 3] of unit length; radii [..., 1] of the pixel's
    cone where the direction ends; bounds [..., 3], where a model asks for them: its
    near, far and radius in this scene.
    """

    origins: Array
    directions: Array
    viewdirs: Array
    radii: Array
    bounds: Array = None


def intrinsics(focal_px, width, height):
    """Inverse intrinsics [3, 3] of a centred pinhole of square pixels."""
    camtopix = [[focal_px, 0, width / 2], [0, focal_px, height / 2], [0, 0, 1]]
    return np.linalg.inv(np.array(camtopix, dtype=np.float64))


def rescale_intrinsics(pixtocams, width_ratio, height_ratio):
    """Inverse intrinsics after resizing images by new / old width and height.

    The ratios are those of the true sizes, which rounding makes differ from the
    nominal factor (half a pixel at the far edge).
    """
    return np.asarray(pixtocams) @ np.diag([1 / width_ratio, 1 / height_ratio, 1.0])


def pixels_to_rays(x_px, y_px, pixtocams, camtoworlds) -> Rays:
    """Rays through the centres of integer pixels (x_px, y_px) [...].

    pixtocams [..., 3, 3] and camtoworlds [..., 3, 4] broadcast against the pixels.
    radii: half the sum of the distances to the x and the y neighbour's direction,
    times 2 / sqrt(12), which matches the variance of a square pixel to the cone's
    (mip-NeRF, arXiv 2103.13415, section 3.1).
    """
    xp = camtoworlds.__array_namespace__()
    signs = xp.asarray([1.0, -1.0, -1.0], dtype=pixtocams.dtype)[:, None]
    flipped = pixtocams * xp.broadcast_to(signs, pixtocams.shape)
    # Sums, since a GPU's matrix products have 11 bits: half a pixel of 1000.
    camera_from_pixel = xp.sum(
        camtoworlds[..., :3, :3, None] * flipped[..., None, :, :], axis=-2
    )
    centre = xp.stack([x_px + 0.5, y_px + 0.5, xp.ones_like(x_px + 0.5)], axis=-1)
    centre = centre.astype(camera_from_pixel.dtype)
    matrices, rows = xp.broadcast_arrays(camera_from_pixel, centre[..., None, :])
    directions = xp.sum(matrices * rows, axis=-1)
    # One pixel to the right or below adds one column of the matrix to a direction.
    step = xp.linalg.vector_norm(camera_from_pixel[..., :2], axis=-2)
    radii = 0.5 * (step[..., 0] + step[..., 1]) * (2 / np.sqrt(12))
    batch = directions.shape[:-1]
    return Rays(
        origins=xp.broadcast_to(camtoworlds[..., :3, 3], directions.shape),
        directions=directions,
        viewdirs=directions / xp.linalg.vector_norm(directions, axis=-1, keepdims=True),
        radii=xp.broadcast_to(radii[..., None], (*batch, 1)),
    )


def check(where, names, pixtocams, camtoworlds, size):
    """ValueError with `where` and the view, where a camera is none.

    A camera is finite, has a field of view, and its pose neither mirrors nor scales.
    names [n]; size: (width, height).
    """
    finite = (np.abs(camtoworlds) < LARGEST).all(axis=(1, 2))
    turns = np.where(finite[:, None, None], camtoworlds[:, :, :3], np.eye(3))
    off = np.abs(turns @ turns.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
    turned = (off <= ROTATION_ERROR) & (np.linalg.det(turns) > 0)
    known = np.isfinite(pixtocams).all(axis=(1, 2))
    lenses = np.where(known[:, None, None], pixtocams, np.eye(3))
    last = np.abs(lenses[:, [1, 2, 2, 2], [0, 0, 1, 2]] - [0, 0, 0, 1])
    plain = (last < 1e-9).all(axis=1)
    across = lenses[:, [0, 1], [0, 1]] * np.array(size)
    sees = (across > FIELD[0]) & (across < FIELD[1])
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        off_centre = np.abs(lenses[:, :2, 2] / across + 0.5)
    middle = (off_centre < MAX_OFF_CENTRE).all(axis=1)
    for good, fault in (
        (finite, f"camtoworlds {{}} is not finite, or not below {LARGEST:g}"),
        (turned, "camtoworlds {} is not a rotation and a place"),
        (known, "pixtocams {} is not finite"),
        (plain & sees.all(axis=1), "pixtocams {}: no lens has such a focal length"),
        (middle, "pixtocams {}: the principal point is far outside"),
    ):
        if not good.all():
            name = names[int(np.argmin(good))]
            raise ValueError(
                f"{where}: " + fault.format(f"of view {faults.shown(str(name))}")
            )


def nearest_rotations(where, names, poses):
    """Poses [n, 3, 3 or 4] of a file with the rotations nearest to those in it.

    names [n]: of its frames or photos. The furthest from a rotation is told. Raises
    ValueError with `where` and a name for one that stretches by more than STRETCH.
    """
    finite = np.isfinite(poses[:, :, :3]).all(axis=(1, 2))
    matrices = np.where(finite[:, None, None], poses[:, :, :3], 0.0)
    # Apart from their size, as 1e200 has no square.
    size = np.abs(matrices).max(axis=(1, 2))
    u, ratios, vt = np.linalg.svd(matrices / np.where(size > 0, size, 1)[:, None, None])
    rotations, stretch = u @ vt, ratios * np.fmin(size, 1e300)[:, None]
    off = np.where(finite, np.abs(stretch - 1).max(axis=1), np.inf)
    mirrored = np.linalg.det(rotations) < 0
    if not (near := (off <= STRETCH) & ~mirrored).all():
        times, alike = stretch.mean(axis=1), ratios[:, 2] > (1 - STRETCH) * ratios[:, 0]
        if (alike & ~mirrored).all() and np.ptp(times) < STRETCH * times.min():
            raise ValueError(
                f"{where}: its rotations are scaled by {np.median(times):.4g}: divide "
                "them by that (of a matrix the first three columns, or its scale)"
            )
        i = int(np.argmin(near))
        least, most = stretch[i, [2, 0]]
        why = f"is none: it stretches lengths {least:.3g} to {most:.3g} times"
        if not finite[i]:
            why = "is not finite"
        elif alike[i] and mirrored[i]:
            why = "is mirrored (its determinant is negative): turn one axis round"
        elif alike[i]:
            why = f"is scaled by {times[i]:.4g}, unlike that of others"
        raise ValueError(
            f"{where}: the rotation of {faults.shown(str(names[i]))} {why}"
        )
    if len(off) and off.max() > ROUNDING:
        log.warning(
            "%s: rotations are inexact, that of %s by %.2g %%: the nearest are taken",
            *(where, faults.name_of(str(names[int(off.argmax())])), 100 * off.max()),
        )
    return np.concatenate([rotations, poses[:, :, 3:]], axis=-1)


def project(points, pixtocam, camtoworld):
    """Image position [..., 2] (pixel centres at +0.5) and depth [...] of points.

    Depth is along the optical axis and is negative behind the camera.
    """
    camera = (np.asarray(points) - camtoworld[:3, 3]) @ camtoworld[:3, :3]
    opencv = camera @ OPENGL_FROM_OPENCV
    pixel = opencv @ np.linalg.inv(pixtocam).T
    depth = opencv[..., 2]
    # A point in the camera's plane has no image: let it fall far outside instead.
    safe = np.where(np.abs(depth) < 1e-12, 1e-12, depth)
    return pixel[..., :2] / safe[..., None], depth


class Frame(NamedTuple):
    """The normalised frame of a scene, relative to the frame of its files."""

    mean: np.ndarray  # [3] of the camera centres
    rotation: np.ndarray  # [3, 3], to the normalised frame
    scale: float  # normalised units of length in one of the given frame

    def normalised(self, camtoworlds):
        """Poses [n, 3, 4] of the given frame in the normalised one."""
        rotated = np.einsum("ij,njk->nik", self.rotation, camtoworlds[:, :, :3])
        moved = (camtoworlds[:, :, 3] - self.mean) @ self.rotation.T
        return np.concatenate([rotated, self.scale * moved[..., None]], axis=-1)

    def given(self, camtoworlds):
        """Poses [n, 3, 4] of the normalised frame in the given one."""
        rotated = np.einsum("ji,njk->nik", self.rotation, camtoworlds[:, :, :3])
        moved = camtoworlds[:, :, 3] @ self.rotation / self.scale + self.mean
        return np.concatenate([rotated, moved[..., None]], axis=-1)

    def transform(self):
        """The similarity [4, 4] that takes points to the normalised frame."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.scale * self.rotation
        matrix[:3, 3] = -self.scale * (self.rotation @ self.mean)
        return matrix


def frame_of(camtoworlds) -> Frame:
    """The frame in which poses are centred, PCA-rotated and scaled to max |t| = 1.

    As mip-NeRF 360 (arXiv 2111.12077); the z axis is the direction of least spread,
    "up". One pose, or several at one place, have no scale: it stays 1.
    """
    centres = camtoworlds[:, :3, 3]
    mean = centres.mean(axis=0)
    values, vectors = np.linalg.eigh((centres - mean).T @ (centres - mean))
    rotation = vectors[:, np.argsort(values)[::-1]].T
    if np.linalg.det(rotation) < 0:
        rotation = np.diag([1.0, 1.0, -1.0]) @ rotation
    # The cameras' mean "up" must point up, else the world stands on its head.
    if (rotation @ camtoworlds[:, :3, 1].mean(axis=0))[2] < 0:
        rotation = np.diag([1.0, -1.0, -1.0]) @ rotation
    extent = np.abs((centres - mean) @ rotation.T).max()
    return Frame(mean, rotation, 1.0 / extent if extent > 1e-9 else 1.0)


def align_similarity(source, target):
    """Similarity (scale, rotation [3, 3], translation [3]) taking source to target.

    Least squares over camera centres *and* axes of poses [n, 3, 4]: each camera
    contributes its centre and, so that cameras on a line still fix the rotation,
    its orientation. Rotation from the orientations' chordal mean (Umeyama 1991
    for scale and translation). Where the centres of either coincide, as of a
    panorama, no scale exists: it is 1, and orientations alone fix the rotation.
    Raises ValueError where a pose is not finite.
    """
    if not (np.isfinite(source).all() and np.isfinite(target).all()):
        raise ValueError("a pose is not finite")
    relative = np.einsum("nij,nkj->ik", target[:, :3, :3], source[:, :3, :3])
    source_mean = source[:, :3, 3].mean(axis=0)
    target_mean = target[:, :3, 3].mean(axis=0)
    source_spread = source[:, :3, 3] - source_mean
    target_spread = target[:, :3, 3] - target_mean
    apart = not (is_one_place(source) or is_one_place(target))
    if apart:
        extent = np.sqrt((source_spread**2).sum() * (target_spread**2).sum())
        relative = relative / len(source) + target_spread.T @ source_spread / extent
    u, _, vt = np.linalg.svd(relative)
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ vt)]) @ vt
    rotated = source_spread @ rotation.T
    scale = (rotated * target_spread).sum() / (source_spread**2).sum() if apart else 1.0
    return scale, rotation, target_mean - scale * rotation @ source_mean


def is_one_place(camtoworlds):
    """Whether all centres are the same, but for rounding."""
    centres = camtoworlds[:, :3, 3]
    away = np.abs(centres - centres.mean(axis=0)).max()
    return bool(away <= ONE_PLACE * max(1.0, np.abs(centres).max()))


def apply_similarity(camtoworlds, scale, rotation, translation):
    """Poses [n, 3, 4] moved by a similarity of the world."""
    rotated = np.einsum("ij,njk->nik", rotation, camtoworlds[:, :3, :3])
    centres = scale * camtoworlds[:, :3, 3] @ rotation.T + translation
    return np.concatenate([rotated, centres[..., None]], axis=-1)


def perturb_poses(camtoworlds, pixtocams, perturb_px, rng, by="rotation", points=None):
    """Poses [n, 3, 4] perturbed so that the image centre moves by perturb_px (rms).

    by: "rotation", `turned`; "translation", `translated`; "both", where each of these
    gives perturb_px / sqrt(2). points [m, 3]: of the scene, or None.
    """
    if by == "both":
        perturb_px = perturb_px / np.sqrt(2)
    if by != "rotation":
        camtoworlds = translated(camtoworlds, pixtocams, perturb_px, rng, points)
    if by != "translation":
        camtoworlds = turned(camtoworlds, pixtocams, perturb_px, rng)
    return camtoworlds


def turned(camtoworlds, pixtocams, perturb_px, rng):
    """Poses [n, 3, 4] turned so that the image centre moves by perturb_px (rms).

    Each camera turns about its own x and y axes by independent normal angles: a
    pose error with the same length in pixels at every depth.
    """
    pixel_angle = pixtocams[:, [1, 0], [1, 0]]
    angles = rng.normal(size=(len(camtoworlds), 2)) * perturb_px / np.sqrt(2)
    angles = np.arctan(angles * pixel_angle)
    poses = camtoworlds.copy()
    for i, (about_x, about_y) in enumerate(angles):
        cx, sx, cy, sy = (
            np.cos(about_x),
            np.sin(about_x),
            np.cos(about_y),
            np.sin(about_y),
        )
        turn_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
        turn_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
        poses[i, :, :3] = camtoworlds[i, :, :3] @ turn_x @ turn_y
    return poses


def translated(camtoworlds, pixtocams, perturb_px, rng, points=None):
    """Poses [n, 3, 4] translated so that the image centre moves by perturb_px (rms).

    Each centre moves along its camera's own x and y axes by independent normal
    lengths. That is the error of what cameras look at (`looked_at`); at other depths
    it is inversely proportional to the depth.
    """
    pixel = pixtocams[:, [0, 1], [0, 1]] * looked_at(camtoworlds, points)[:, None]
    lengths = rng.normal(size=pixel.shape) * perturb_px / np.sqrt(2) * pixel
    moved = camtoworlds.copy()
    moved[:, :, 3] += (camtoworlds[:, :, :2] * lengths[:, None]).sum(axis=2)
    return moved


def looked_at(camtoworlds, points=None):
    """Depth [n] of what the cameras look at, along their optical axes; above 0.

    That is `focus_of`; a camera that stands there or beyond has the median depth. Where
    the axes are parallel or part, it is the median depth of the points [m, 3]; without
    those, by convention, 1 of the normalised frame (`frame_of`).
    """
    centres, axes = camtoworlds[:, :, 3], -camtoworlds[:, :, 2]
    least = ONE_PLACE * max(1.0, np.abs(centres).max())
    spread, focus = 1 / frame_of(camtoworlds).scale, focus_of(camtoworlds)
    if focus is not None:
        depths = ((focus - centres) * axes).sum(axis=1)
        if least < (usual := np.median(depths)) < MAX_FOCUS * spread:
            return np.where(depths > least, depths, usual)
    points = np.empty((0, 3)) if points is None else points
    of_views = ((points - c) @ a for c, a in zip(centres, axes, strict=True))
    ahead = [np.median(d[d > least]) for d in of_views if (d > least).any()]
    return np.full(len(centres), np.median(ahead) if ahead else spread)


def focus_of(camtoworlds):
    """The point [3] closest to all optical axes; None where they have none.

    (Parallel axes, or one camera.)
    """
    origins, axes = camtoworlds[:, :, 3], -camtoworlds[:, :, 2]
    across = np.eye(3) - axes[:, :, None] * axes[:, None, :]
    matrix = across.sum(axis=0)
    if np.linalg.cond(matrix) > 1e8:
        return None
    return np.linalg.solve(matrix, (across @ origins[..., None]).sum(axis=0)[:, 0])
