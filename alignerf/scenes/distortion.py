"""Lens distortion undone: from a photo as taken to a pinhole image.

Notation: `camtopix` [3, 3] intrinsics with pixel centres at +0.5; `distortion` [5]
k1, k2, p1, p2, k3 of OpenCV's polynomial model (COLMAP's SIMPLE_RADIAL, RADIAL and
OPENCV are cases of it), or [4] k1, k2, k3, k4 of its fisheye, by the angle from the
axis, or [13] of another of COLMAP's models: its number, then its parameters after the
principal point, then zeros. OpenCV itself puts pixel centres at integers: every call
into it shifts the principal point by half a pixel.
"""

import functools

import cv2
import numpy as np
import pycolmap

from alignerf.io import faults
from alignerf.scenes import prepare

# How far, in pixels, a point may be from itself after undistorting and distorting.
ROUND_TRIP_PX = 0.05
# A view's focal length is at most so many times its lens's; of real ones it is nearer.
MAX_TIMES = 2
# What a fisheye sees further from the axis, in radians, no pinhole view shows: there
# it is stretched. A view's sides are as near as its corners need.
MAX_ANGLE = 1.25
WIDEST = np.tan(MAX_ANGLE) / np.sqrt(2)
# At how many angles from the axis a lens is looked through for a fold.
ANGLES = 100
# How far Lanczos reaches.
KERNEL_PX = 4
# Points that are projected at once.
MAX_POINTS = 2**20
# Coefficients of OpenCV's two models, and of COLMAP's that are cases of these.
POLYNOMIAL, FISHEYE = ("k1", "k2", "p1", "p2", "k3"), ("k1", "k2", "k3", "k4")
CASES = {
    POLYNOMIAL: "SIMPLE_PINHOLE PINHOLE SIMPLE_RADIAL RADIAL OPENCV FULL_OPENCV",
    FISHEYE: "SIMPLE_FISHEYE FISHEYE SIMPLE_RADIAL_FISHEYE RADIAL_FISHEYE "
    "OPENCV_FISHEYE",
}
OTHER = 13
PANORAMA = (
    "EQUIRECTANGULAR panoramas are no pinhole's images: make cube faces of them first, "
    "as `ns-process-data images --camera-type equirectangular` of nerfstudio and "
    "panorama_sfm.py of pycolmap's examples do"
)
WILD = (
    "the estimate of this lens is wild. Give the photos alone, so that COLMAP finds it "
    "anew; or estimate it with fewer numbers, as of SIMPLE_RADIAL (here: "
    "colmap.camera_model)"
)


@functools.cache
def parameters(model):
    """Names of the parameters of one of COLMAP's camera models, fx, fy, cx, cy first.

    Of some there is one focal length, f. Raises ValueError for another model.
    """
    if model == "EQUIRECTANGULAR":
        raise ValueError(PANORAMA)
    if model == "INVALID" or model not in pycolmap.CameraModelId.__members__:
        raise ValueError(
            f"camera model {faults.shown(model)} is none of COLMAP's: undistort the "
            "photos with the program that wrote it"
        )
    made = pycolmap.Camera.create_from_model_name(1, model, 1.0, 1, 1)
    return made.params_info.split(", ")


def of_model(model, values):
    """Coefficients of a camera model of COLMAP's; values: {name: value} of them."""
    values = {name: value for name, value in values.items() if value}
    for names, cases in CASES.items():
        if model in cases.split():
            of_case = {{"k": "k1"}.get(name, name): v for name, v in values.items()}
            if of_case.keys() <= set(names):
                return np.array([of_case.get(name, 0.0) for name in names])
    model = {"SIMPLE_DIVISION": "DIVISION"}.get(model, model)
    rest = [values.get(name, 0.0) for name in parameters(model)[4:]]
    found = np.zeros(OTHER)
    found[: 1 + len(rest)] = int(pycolmap.CameraModelId.__members__[model]), *rest
    return found


def camera(camtopix, distortion, size=(1, 1)):
    """The pycolmap.Camera of a lens."""
    model, rest = "FULL_OPENCV", [*distortion, 0.0, 0.0, 0.0]
    if len(distortion) == len(FISHEYE):
        model, rest = "OPENCV_FISHEYE", distortion
    elif len(distortion) == OTHER:
        model = pycolmap.CameraModelId(int(distortion[0])).name
        rest = distortion[1 : len(parameters(model)) - 3]
    params = [*camtopix[[0, 1], [0, 1]], *camtopix[:2, 2], *rest]
    width, height = map(int, size)
    return pycolmap.Camera(model=model, width=width, height=height, params=params)


def is_pinhole(distortion):
    """Whether a photo is one of a pinhole already; a fisheye's own projection bends."""
    return len(distortion) == len(POLYNOMIAL) and not np.any(distortion)


def pinhole_camera(camtopix, distortion, width, height):
    """Intrinsics [3, 3] of the largest pinhole view that needs no pixel outside.

    The view keeps width, height and the pixels' shape, and shows 130 degrees at most,
    each way. Its outermost pixel centres
    lie within those of the photo, so that no border is invented. Raises ValueError
    for a distortion that folds the image over, which no pinhole view undoes.
    """
    if is_pinhole(distortion):
        return np.array(camtopix, dtype=np.float64)
    left, top, right, bottom = _inner_rectangle(camtopix, distortion, width, height)
    if not (right > left and bottom > top):
        raise ValueError(f"{_text(camtopix, distortion)} leaves no image: {WILD}")
    focal = np.array([camtopix[0, 0], camtopix[1, 1]])
    tightest = np.array([width - 1, height - 1]) / [right - left, bottom - top]
    times = (tightest / focal).max()
    if times > MAX_TIMES:
        text = _text(camtopix, distortion)
        raise ValueError(f"{text} bends the image to {times:.1f} of its size: {WILD}")
    focal = focal * times
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
    if len(distortion) != OTHER:
        of_lens = cv2.fisheye if len(distortion) == len(FISHEYE) else cv2
        values = np.asarray(distortion, np.float64)
        own, to = opencv(camtopix), opencv(pinhole)
        return of_lens.initUndistortRectifyMap(
            own, values, np.eye(3), to, tuple(size), cv2.CV_32FC1
        )
    (width, height), inverse = size, np.linalg.inv(pinhole)
    found = np.empty((2, height, width), np.float32)
    rows = max(MAX_POINTS // width, 1)
    for top in range(0, height, rows):
        some = found[:, top : top + rows]
        y, x = np.indices(some.shape[1:]) + 0.5
        points = (
            np.stack([x, y + top], axis=-1).reshape(-1, 2) @ inverse[:2, :2].T
            + inverse[:2, 2]
        )
        pixels = distort_points(points, camtopix, distortion)
        some[:] = pixels.T.reshape(some.shape) - 0.5
    return found


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
    points = np.asarray(points, dtype=np.float64)
    space = np.concatenate([points, np.ones((len(points), 1))], axis=-1)
    return camera(camtopix, distortion).img_from_cam(space)


def _straightened(pixels, camtopix, distortion):
    """Normalised pinhole points [m, 2] of pixels [n, 2].

    Those too far from the axis are left out. Raises ValueError for a lens whose image
    folds over before.
    """
    inverse = np.linalg.inv(camtopix)[:2]
    apart = pixels @ inverse[:, :2].T + inverse[:, 2]
    radius = np.hypot(*apart.T)
    away = apart / np.maximum(radius, 1e-12)[:, None]
    tangents = np.tan(np.linspace(0, MAX_ANGLE, ANGLES))
    bent = distort_points(
        (tangents[:, None, None] * away).reshape(-1, 2), camtopix, distortion
    )
    # How far from the axis the lens puts each direction, towards each pixel.
    bent = (bent @ inverse[:, :2].T + inverse[:, 2]).reshape(ANGLES, -1, 2)
    reached = (bent * away).sum(axis=-1)
    most = np.fmax.accumulate(reached)
    if ((most[:-1] < radius) & ~(np.diff(reached, axis=0) > 0)).any():
        raise ValueError(f"{_text(camtopix, distortion)} folds the image: {WILD}")
    points = camera(camtopix, distortion).cam_from_img(pixels)
    # Beyond these a fisheye's direction may be no point of a pinhole's at all.
    seen = (most[-1] > radius) & ~(np.hypot(*points.T) >= tangents[-1])
    back = distort_points(points[seen], camtopix, distortion)
    if not np.abs(back - pixels[seen]).max(initial=0) < ROUND_TRIP_PX:
        raise ValueError(f"{_text(camtopix, distortion)} cannot be undone: {WILD}")
    return points[seen]


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
    sides = []
    for i, side in enumerate(_border(width, height)):
        across = _straightened(side, camtopix, distortion)[:, i % 2]
        sides.append(
            across.max(initial=-WIDEST) if i < 2 else across.min(initial=WIDEST)
        )
    return sides


def _check_inside(pinhole, camtopix, distortion, width, height):
    """Raise ValueError unless the pinhole view's border falls inside the photo."""
    inverse = np.linalg.inv(pinhole)
    for side in _border(width, height):
        points = side @ inverse[:2, :2].T + inverse[:2, 2]
        pixels = distort_points(points, camtopix, distortion)
        # The rectangle was measured at whole pixels: a curve may bulge in between.
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        if (low < 0).any() or (high > [width, height]).any():
            raise ValueError(f"{_text(camtopix, distortion)} folds the image: {WILD}")


def opencv(camtopix):
    """The same intrinsics with OpenCV's pixel centres, at integers."""
    shifted = np.array(camtopix, dtype=np.float64)
    shifted[:2, 2] -= 0.5
    return shifted


def _text(camtopix, distortion):
    """A lens in words, by its parameters that are not 0."""
    made = camera(camtopix, distortion)
    named = zip(parameters(made.model.name), made.params, strict=True)
    values = ", ".join(f"{name} {value:g}" for name, value in named if value)
    model = "OPENCV" if len(distortion) == len(POLYNOMIAL) else made.model.name
    return f"a distortion of {model} ({values})"
