"""How a photo became the picture that a render shows: resized, undistorted, cropped.

Programs undo a lens in different ways, or not at all. A photo in another geometry than
its render looks misaligned, most at its corners. So all known ways are tried on some
pairs, and the way is taken that leaves least flow.

Notation: a lens is camtopix [3, 3], pixel centres at +0.5, and distortion, as of
`scenes.distortion`; sizes are (width, height); images [h, w, 3]
uint8 RGB.
"""

from typing import NamedTuple

import cv2
import numpy as np
import pycolmap

from alignerf.scenes import cameras, distortion, prepare

# The ways by name, in words. The first that is as good as the best is taken.
WAYS = {
    "taken": "that of the photos, with distortion",
    "kept": "undistorted, at the photo's focal length",
    "opencv": "undistorted and cropped by OpenCV (gsplat)",
    "pinhole": "undistorted to the largest image without a border",
    "colmap": "undistorted by COLMAP",
}
# Flow is looked for in pictures of at most this width; DIS fails under 32 px a side.
SMALL_PX, MIN_PX = 640, 48
# Lengths of flow nearer than this, in px of the small pictures, are equally good.
EQUAL_PX = 0.1


class Shown(NamedTuple):
    """A way, for photos and renders of one lens and size.

    camtopix [3, 3]: of the pinhole picture that both become; size: its. lens: of the
    photo, at photo_size. render_lens: (camtopix, distortion) of a render that shows the
    distortion, so that it is undone in both; None for one that does not.
    """

    way: str
    camtopix: np.ndarray
    size: tuple
    lens: tuple
    photo_size: tuple
    render_lens: tuple | None = None

    def picture(self, photo):
        """The photo [H, W, 3] as the render shows it [h, w, 3]."""
        if self.render_lens is not None:
            # Both are resampled alike: a difference in sharpness looks like flow.
            return self.render(resized(photo, self.size))
        image, lens = smaller(photo, self.lens, self.camtopix, self.size)
        if is_same(lens, self.camtopix, image, self.size):
            return image
        at = distortion.positions(*lens, self.camtopix, self.size)
        return cv2.remap(
            image, *at, cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REPLICATE
        )

    def mask(self, mask):
        """A photo's mask [H, W, 3], 255 where it counts, in the same geometry."""
        if not is_same(self.lens, self.camtopix, mask, self.size):
            mask = distortion.eroded(mask)
        return np.where(self.inside()[..., None], self.picture(mask), np.uint8(0))

    def inside(self):
        """Mask [h, w]: the photo shows what the picture has there."""
        x, y = distortion.positions(*self.lens, self.camtopix, self.size)
        width, height = self.photo_size
        return (x >= -0.5) & (y >= -0.5) & (x <= width - 0.5) & (y <= height - 0.5)

    def render(self, image):
        """The render's own pixels, its distortion undone where it has one."""
        if self.render_lens is None:
            return image
        return distortion.undistort(image, *self.render_lens, self.camtopix)


def ways(lens, photo_size, render_size, where) -> list[Shown]:
    """All ways in which a photo can have become a picture of a render's size.

    Raises ValueError with both sizes where none has the shape of the render.
    """
    camtopix, coefficients = lens
    frames = [("taken", camtopix, photo_size)]
    if not distortion.is_pinhole(coefficients):
        frames.append(("kept", camtopix, photo_size))
        frames += undone(camtopix, coefficients, photo_size)
    found = []
    for way, own, size in frames:
        across = render_size[0] / size[0], render_size[1] / size[1]
        if not prepare.has_shape(render_size, size):
            continue
        scaled, render_lens = np.diag([*across, 1.0]) @ own, None
        if way == "taken" and not distortion.is_pinhole(coefficients):
            render_lens = (scaled, coefficients)
            scaled = distortion.pinhole_camera(scaled, coefficients, *render_size)
        found.append(
            Shown(way, scaled, tuple(render_size), lens, tuple(photo_size), render_lens)
        )
    if not found:
        shapes = ", ".join(f"{size[0]}x{size[1]}" for _, _, size in frames)
        raise ValueError(
            f"{where}: {render_size[0]}x{render_size[1]} pixels are of another shape "
            f"than its photo ({shapes}): a photo and its render must show the same"
        )
    return found


def undone(camtopix, coefficients, size):
    """(way, camtopix, size) of the pinhole pictures that programs make of a lens."""
    found, of_opencv = [], opencv_camera(camtopix, coefficients, size)
    if of_opencv is not None:
        found.append(("opencv", *of_opencv))
    try:
        pinhole = distortion.pinhole_camera(camtopix, coefficients, *size)
        found.append(("pinhole", pinhole, size))
    except ValueError:
        # Of a lens that no pinhole view undoes; other ways may.
        pass
    camera = distortion.camera(camtopix, coefficients, size)
    undistorted = pycolmap.undistort_camera(pycolmap.UndistortCameraOptions(), camera)
    of_colmap = undistorted.calibration_matrix()
    found.append(("colmap", of_colmap, (undistorted.width, undistorted.height)))
    return found


def opencv_camera(camtopix, coefficients, size):
    """(camtopix, size) of OpenCV's picture without a border; None where it has none."""
    own, values = distortion.opencv(camtopix), np.asarray(coefficients, np.float64)
    x, y, (width, height) = 0, 0, size
    if len(values) == distortion.OTHER:
        return None
    if len(values) == len(distortion.FISHEYE):
        made = cv2.fisheye.estimateNewCameraMatrixForUndistortRectify(
            own, values, size, np.eye(3), balance=0.0
        )
    else:
        made, (x, y, width, height) = cv2.getOptimalNewCameraMatrix(
            own, values, size, 0
        )
    if min(width, height) < 1 or not np.isfinite(made).all():
        return None
    back = np.array([[1, 0, 0.5 - x], [0, 1, 0.5 - y], [0, 0, 1]])
    return back @ made, (width, height)


def choose(samples) -> tuple[str, dict]:
    """(the way that fits, {way: flow in px of the small pictures}).

    samples: (photo, render, ways) of some views, `ways` as of the function.
    """
    lengths = {}
    for photo, render, found in samples:
        for shown in found:
            px = apart_px(shown.picture(photo), shown.render(render))
            lengths.setdefault(shown.way, []).append(px)
    most = max(map(len, lengths.values()))
    mean = {way: float(np.mean(px)) for way, px in lengths.items() if len(px) == most}
    best = min(mean.values())
    chosen = next(way for way in WAYS if mean.get(way, np.inf) <= best + EQUAL_PX)
    return chosen, mean


def apart_px(first, second):
    """How far two images are apart: the mean length of the shorter 9 tenths of flow."""
    pair = [small(image) for image in (first, second)]
    if min(pair[0].shape) < MIN_PX:
        return float(np.abs(pair[0].astype(float) - pair[1]).mean())
    flow = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    length_px = np.linalg.norm(flow.calc(*pair, None), axis=-1)
    return float(length_px[length_px <= np.quantile(length_px, 0.9)].mean())


def resized(image, size):
    """An image of another size (width, height), by area averaging where smaller."""
    if image.shape[1::-1] == tuple(size):
        return image
    is_smaller = size[0] < image.shape[1]
    kind = cv2.INTER_AREA if is_smaller else cv2.INTER_LANCZOS4
    return cv2.resize(image, tuple(size), interpolation=kind)


def small(image):
    """Luminance [h, w] uint8 of an image, at most SMALL_PX wide."""
    grey = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    height, width = grey.shape
    if width <= SMALL_PX:
        return grey
    size = SMALL_PX, max(round(height * SMALL_PX / width), 1)
    return cv2.resize(grey, size, interpolation=cv2.INTER_AREA)


def smaller(photo, lens, camtopix, size):
    """(photo, lens) made smaller by area averaging to a picture's scale, if larger."""
    own, scale = lens[0], (camtopix[[0, 1], [0, 1]] / lens[0][[0, 1], [0, 1]]).max()
    height, width = photo.shape[:2]
    # A photo that only was resized has the render's own size, rounded as it may be.
    near = abs(scale * width / size[0] - 1) < prepare.SAME_SHAPE - 1
    wanted = size if near and distortion.is_pinhole(lens[1]) else None
    wanted = wanted or tuple(max(round(scale * side), 1) for side in (width, height))
    if scale >= 1 or wanted == (width, height):
        return photo, lens
    across = wanted[0] / width, wanted[1] / height
    image = cv2.resize(photo, wanted, interpolation=cv2.INTER_AREA)
    return image, (np.diag([*across, 1.0]) @ own, lens[1])


def is_same(lens, camtopix, image, size):
    """Whether an image of a lens is the picture already."""
    return (
        distortion.is_pinhole(lens[1])
        and image.shape[1::-1] == tuple(size)
        and np.allclose(lens[0], camtopix, rtol=1e-9, atol=1e-6)
    )


def photos_size(shown: Shown):
    """(width, height) of the same picture as large as the photo allows."""
    # Each side by its own zoom: a render's size is rounded, so its pixels may be a
    # little longer than wide. Far longer ones come from OpenCV's crop, and stay.
    zoom = shown.lens[0][[0, 1], [0, 1]] / shown.camtopix[[0, 1], [0, 1]]
    if not 1 / prepare.SAME_SHAPE < zoom[0] / zoom[1] < prepare.SAME_SHAPE:
        zoom[1] = zoom[0]
    width, height = (max(round(side), 1) for side in zoom * shown.size)
    return width, height


def at_size(shown: Shown, size) -> Shown:
    """The same picture at another size, for an export."""
    across = size[0] / shown.size[0], size[1] / shown.size[1]
    inverse = cameras.rescale_intrinsics(np.linalg.inv(shown.camtopix), *across)
    return shown._replace(camtopix=np.linalg.inv(inverse), size=size, render_lens=None)
