"""Lens distortion undone: from a photo as taken to a pinhole image.

Notation: `camtopix` [3, 3] intrinsics with pixel centres at +0.5; `distortion` [5]
k1, k2, p1, p2, k3 of OpenCV's polynomial model (COLMAP's SIMPLE_RADIAL, RADIAL and
OPENCV are cases of it), or [4] k1, k2, k3, k4 of its fisheye, by the angle from the
axis. OpenCV itself puts pixel centres at integers: every call into it shifts the
principal point by half a pixel.
"""

import cv2
import numpy as np

from alignerf.scenes import prepare

# How far, in pixels, a point may be from itself after undistorting and distorting.
ROUND_TRIP_PX = 0.05
# What a fisheye sees further from the axis, in radians, no pinhole view shows.
MAX_ANGLE = 1.4
# How far Lanczos reaches.
KERNEL_PX = 4


def is_fisheye(distortion):
    """Whether coefficients are those of a fisheye, whose own projection bends too."""
    return len(distortion) == 4


def is_pinhole(distortion):
    """Whether a photo is one of a pinhole already."""
    return not is_fisheye(distortion) and not np.any(distortion)


def pinhole_camera(camtopix, distortion, width, height):
    """Intrinsics [3, 3] of the largest pinhole view that needs no pixel outside.

    The view keeps width, height and the pixels' shape. Its outermost pixel centres
    lie within those of the photo, so that no border is invented. Raises ValueError
    for a distortion that folds the image over, which no pinhole view undoes.
    """
    if is_pinhole(distortion):
        return np.array(camtopix, dtype=np.float64)
    left, top, right, bottom = _inner_rectangle(camtopix, distortion, width, height)
    if not (right > left and bottom > top):
        raise ValueError(f"a distortion of {_text(distortion)} leaves no image")
    focal = np.array([camtopix[0, 0], camtopix[1, 1]])
    tightest = np.array([width - 1, height - 1]) / [right - left, bottom - top]
    focal = focal * (tightest / focal).max()
    centre = np.array([width, height]) / 2 - focal * (
        np.array([left + right, top + bottom]) / 2
    )
    pinhole = np.array([[focal[0], 0, centre[0]], [0, focal[1], centre[1]], [0, 0, 1]])
    _check_inside(pinhole, camtopix, distortion, width, height)
    return pinhole


def undistort(image, camtopix, distortion, pinhole):
    """The image [h, w, 3] uint8 seen through `pinhole` [3, 3], of the same size."""
    if is_pinhole(distortion):
        return image
    at = positions(camtopix, distortion, pinhole, image.shape[1::-1])
    # Lanczos, since resampling blur counts as misalignment blur does; the map stays
    # inside the image, where reflection only feeds the kernel's outer taps.
    return cv2.remap(image, *at, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REFLECT_101)


def positions(camtopix, distortion, pinhole, size):
    """(x, y) [h, w] float32: where a pinhole picture's pixels lie in a lens's image."""
    values = np.asarray(distortion, np.float64)
    of_lens = cv2.fisheye if is_fisheye(values) else cv2
    own, to = opencv(camtopix), opencv(pinhole)
    return of_lens.initUndistortRectifyMap(
        own, values, np.eye(3), to, tuple(size), cv2.CV_32FC1
    )


def pinhole_views(
    names, lenses, camtoworlds, *, width, height, photos, where, masks=None
):
    """PosedViews of photos as taken, each lens's distortion undone.

    lenses: (camtopix [3, 3], distortion [5]) of each view at width x height; photos,
    masks: a `Photo` of each. Raises ValueError naming `where` for a distortion that no
    pinhole view undoes.
    """
    pinholes = []
    for name, lens in zip(names, lenses, strict=True):
        try:
            pinholes.append(pinhole_camera(*lens, width, height))
        except ValueError as error:
            raise ValueError(f"{where}: {name}: {error}") from None

    def undistorted(photo, lens, pinhole):
        return photo.then(lambda image: undistort(image, *lens, pinhole))

    def undistorted_mask(mask, lens, pinhole):
        # What is hidden must not come through a kernel that reaches over its edge.
        hidden = mask if is_pinhole(lens[1]) else mask.then(eroded)
        return undistorted(hidden, lens, pinhole)

    return prepare.PosedViews(
        names=names,
        pixtocams=np.linalg.inv(np.stack(pinholes)),
        camtoworlds=camtoworlds,
        width=width,
        height=height,
        photos=list(map(undistorted, photos, lenses, pinholes)),
        masks=masks and list(map(undistorted_mask, masks, lenses, pinholes)),
    )


def eroded(mask):
    """A mask [h, w, 3] uint8 without what a Lanczos kernel mixes with hidden pixels."""
    side = 2 * KERNEL_PX + 1
    # Beyond the border nothing is hidden.
    return cv2.erode(mask, np.ones((side, side), np.uint8), borderValue=(255,) * 4)


def distort_points(points, camtopix, distortion):
    """Pixels [n, 2] at +0.5 in the photo of normalised pinhole points [n, 2]."""
    x, y = np.asarray(points, dtype=np.float64).T
    if is_fisheye(distortion):
        radius = np.hypot(x, y)
        bent = _bent(np.arctan(radius), distortion)[0]
        scale = np.divide(bent, radius, out=np.ones_like(radius), where=radius > 0)
        return scale[:, None] * points @ camtopix[:2, :2].T + camtopix[:2, 2]
    k1, k2, p1, p2, k3 = distortion
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([u, v], axis=-1) @ camtopix[:2, :2].T + camtopix[:2, 2]


def _bent(angle, distortion):
    """A fisheye's radius [n], in focal lengths, at angles from the axis; its slope."""
    powers = np.stack([angle ** (2 * k) for k in range(5)])
    factors = np.array([1.0, *distortion])
    slopes = factors * np.array([1.0, 3, 5, 7, 9])
    return angle * (factors @ powers), slopes @ powers


def _straightened(pixels, camtopix, distortion):
    """Normalised pinhole points [m, 2] of pixels [n, 2] by a fisheye, and which [n].

    Those too far from the axis are left out. Raises ValueError for a lens whose image
    folds over before.
    """
    inverse = np.linalg.inv(camtopix)
    points = pixels @ inverse[:2, :2].T + inverse[:2, 2]
    radius, grid = np.hypot(*points.T), np.linspace(0, MAX_ANGLE, 500)
    reached, slope = _bent(grid, distortion)
    needed = grid <= np.interp(radius.max(), np.maximum.accumulate(reached), grid)
    if (slope[needed] <= 0).any():
        raise ValueError(f"a distortion of {_text(distortion)} folds the image")
    angle = np.interp(radius, reached[needed], grid[needed])
    for _ in range(20):
        bent, slope = _bent(angle, distortion)
        angle = np.clip(angle - (bent - radius) / slope, 0, MAX_ANGLE)
    seen = angle < MAX_ANGLE
    scale = np.tan(angle[seen]) / np.maximum(radius[seen], 1e-12)
    return points[seen] * scale[:, None], seen


def _polynomial(pixels, camtopix, distortion):
    """`_straightened` by OpenCV's polynomial model, of all pixels."""
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-12)
    points = cv2.undistortPoints(
        pixels[:, None] - 0.5,
        opencv(camtopix),
        np.asarray(distortion, dtype=np.float64),
        criteria=criteria,
    )[:, 0]
    return points, np.ones(len(pixels), bool)


def _border(width, height):
    """Centres [n, 2] of the outermost pixels, side by side: left, top, right, bottom"""
    x = np.arange(width) + 0.5
    y = np.arange(height) + 0.5
    return (
        np.stack([np.full(height, 0.5), y], axis=-1),
        np.stack([x, np.full(width, 0.5)], axis=-1),
        np.stack([np.full(height, width - 0.5), y], axis=-1),
        np.stack([x, np.full(width, height - 0.5)], axis=-1),
    )


def _inner_rectangle(camtopix, distortion, width, height):
    """Normalised left, top, right, bottom of what every row and column contains."""
    sides, straight = [], _straightened if is_fisheye(distortion) else _polynomial
    for side in _border(width, height):
        points, seen = straight(side, camtopix, distortion)
        if not len(points):
            raise ValueError(f"a fisheye of {_text(distortion)} has no pinhole view")
        back = distort_points(points, camtopix, distortion)
        if not np.abs(back - side[seen]).max() < ROUND_TRIP_PX:
            raise ValueError(f"a distortion of {_text(distortion)} cannot be undone")
        sides.append(points)
    left, top, right, bottom = sides
    return left[:, 0].max(), top[:, 1].max(), right[:, 0].min(), bottom[:, 1].min()


def _check_inside(pinhole, camtopix, distortion, width, height):
    """Raise ValueError unless the pinhole view's border falls inside the photo."""
    inverse = np.linalg.inv(pinhole)
    for side in _border(width, height):
        points = side @ inverse[:2, :2].T + inverse[:2, 2]
        pixels = distort_points(points, camtopix, distortion)
        # The rectangle was measured at whole pixels: a curve may bulge in between.
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        if (low < 0).any() or (high > [width, height]).any():
            raise ValueError(f"a distortion of {_text(distortion)} folds the image")


def opencv(camtopix):
    """The same intrinsics with OpenCV's pixel centres, at integers."""
    shifted = np.array(camtopix, dtype=np.float64)
    shifted[:2, 2] -= 0.5
    return shifted


def _text(distortion):
    return ", ".join(f"{value:g}" for value in distortion)
