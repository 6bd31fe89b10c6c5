"""Warps by a flow, where they are valid, and the round trip that displaces nothing.

Notation: `flow_px` [h, w, 2] float32, x then y in pixels: the value for pixel x is
taken at x + flow_px(x). x is an array index, so a pixel is the square of side 1
around an integer and the image covers [-0.5, w - 0.5] x [-0.5, h - 0.5].
"""

import cv2
import numpy as np

from alignerf.io import images

KERNELS = {
    "lanczos": cv2.INTER_LANCZOS4,
    "cubic": cv2.INTER_CUBIC,
    "bilinear": cv2.INTER_LINEAR,
}

# cv2.remap holds positions in 16-bit integers.
MAX_SIDE_PX = 32766

# A round trip nearer than this to its start is called undisplaced: a fifteenth of
# the least misalignment of interest, and over twice cv2.remap's own rounding of
# positions to 1/32 px.
ROUND_TRIP_PX = 0.05

# Neighbours of one surface that a flow brings together differ in depth by less.
OCCLUSION_TOLERANCE = 0.1


def check_image(image, name="image"):
    """Raise ValueError unless image is [h, w, 3] uint8 with sides that warps allow."""
    image = np.asarray(image)
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise ValueError(
            f"{name} must be 8-bit RGB [h, w, 3], not {image.dtype} {list(image.shape)}"
        )
    _check_sides(image.shape, name)


def check_flow(flow_px, name="flow"):
    """Raise ValueError unless flow_px is [h, w, 2], floating and finite."""
    flow_px = np.asarray(flow_px)
    if flow_px.ndim != 3 or flow_px.shape[2] != 2 or flow_px.dtype.kind != "f":
        raise ValueError(
            f"{name} must be floating [h, w, 2], "
            f"not {flow_px.dtype} {list(flow_px.shape)}"
        )
    _check_sides(flow_px.shape, name)
    if not np.isfinite(flow_px).all():
        raise ValueError(f"{name} holds values that are not finite")


def warp(image, flow_px, *, kernel="lanczos"):
    """The image [h, w, 3] uint8 taken at x + flow_px(x).

    Lanczos by default: bilinear smooths the photo, which alone raises its PSNR
    against a blurred render by half a decibel. Overshoot is clipped to 0..255;
    positions are rounded to 1/32 px; beyond the frame its border pixels go on
    (`in_frame` says where). Zero flow is the identity.
    """
    check_image(image)
    check_flow(flow_px)
    if kernel not in KERNELS:
        raise ValueError(f"kernel {kernel!r} is not one of {', '.join(KERNELS)}")
    if image.shape[:2] != flow_px.shape[:2]:
        raise ValueError(
            f"image {list(image.shape[:2])} and flow {list(flow_px.shape[:2])} "
            "differ in size"
        )
    return _sample(image, _positions(flow_px), kernel)


def in_frame(flow_px):
    """Mask [h, w]: x + flow_px(x) is finite and lies on the image."""
    h, w = flow_px.shape[:2]
    at = _positions(flow_px)
    with np.errstate(invalid="ignore"):
        inside_x = (at[..., 0] >= -0.5) & (at[..., 0] <= w - 0.5)
        return inside_x & (at[..., 1] >= -0.5) & (at[..., 1] <= h - 0.5)


def sees_only(flow_px, counts):
    """Mask [h, w]: x + flow_px(x) lies among pixels that count, those around too."""
    shown = warp(images.of_mask(counts), flow_px, kernel="bilinear")
    return (shown == 255).all(axis=-1)


def consistent(forward_px, backward_px, *, tolerance_px):
    """Mask [h, w]: |forward(x) + backward(x + forward(x))| <= tolerance_px, in frame.

    forward: render -> photo; backward: photo -> render. False where forward leaves
    the image, since nothing answers it there.
    """
    check_flow(forward_px, "forward flow")
    check_flow(backward_px, "backward flow")
    if forward_px.shape != backward_px.shape:
        raise ValueError("forward and backward flow differ in size")
    if not tolerance_px >= 0:
        raise ValueError(f"tolerance_px must not be negative, is {tolerance_px}")
    back = _sample(backward_px, _positions(forward_px), "bilinear")
    miss_px = np.linalg.norm(forward_px + back, axis=-1)
    return (miss_px <= tolerance_px) & in_frame(forward_px)


def compose(first_px, second_px):
    """One flow [h, w, 2] for a warp by second_px whose result is warped by first_px.

    first(x) + second(x + first(x)), bilinear between pixels.
    """
    check_flow(first_px, "first flow")
    check_flow(second_px, "second flow")
    if first_px.shape != second_px.shape:
        raise ValueError("first and second flow differ in size")
    second_px = np.asarray(second_px, dtype=np.float32)
    return first_px + _sample(second_px, _positions(first_px), "bilinear")


def unoccluded(flow_px, depth, *, tolerance=OCCLUSION_TOLERANCE):
    """Mask [h, w]: nothing nearer goes to the same pixel of the photo.

    depth [h, w] of the render, positive, in any unit; infinite is far away. Of the
    pixels that land on one, those count that are at most a share `tolerance` farther
    than the nearest. Where the flow leaves the image nothing hides. Raises ValueError.
    """
    check_flow(flow_px)
    depth = np.asarray(depth, dtype=np.float32)
    if depth.shape != flow_px.shape[:2]:
        sizes = f"{list(depth.shape)} and flow {list(flow_px.shape[:2])}"
        raise ValueError(f"depth {sizes} differ in size")
    if not (depth > 0).all():
        raise ValueError("depth holds values that are not positive")
    inside = in_frame(flow_px)
    at = np.rint(_positions(flow_px)[inside]).astype(int)
    h, w = depth.shape
    landed = at[:, 1].clip(0, h - 1), at[:, 0].clip(0, w - 1)
    nearest = np.full((h, w), np.inf, np.float32)
    np.minimum.at(nearest, landed, depth[inside])
    visible = np.ones((h, w), bool)
    visible[inside] = depth[inside] <= nearest[landed] * (1 + tolerance)
    return visible


def invert(flow_px, *, iterations=30, tolerance_px=ROUND_TRIP_PX):
    """Inverse [h, w, 2] of a flow, and the mask [h, w] where it is one.

    g = -f(y + g) by fixed-point iteration, which converges where neighbouring flows
    differ by less than a pixel. Valid: warping the positions x + f(x) by g, with the
    kernel that images get, returns y to tolerance_px. That also finds the places
    where f jumps and the kernel mixes both sides.
    """
    check_flow(flow_px)
    flow_px = np.asarray(flow_px, dtype=np.float32)
    inverse_px = -flow_px
    for _ in range(iterations):
        inverse_px = -_sample(flow_px, _positions(inverse_px), "bilinear")
    # Displacements, not positions: float32 holds them finely far from the origin,
    # and the border's rule makes no error of them.
    returned_px = _sample(flow_px, _positions(inverse_px), "lanczos") + inverse_px
    valid = np.linalg.norm(returned_px, axis=-1) < tolerance_px
    return inverse_px, valid & in_frame(inverse_px)


def round_trip(photo, flow_px):
    """The resample-only control: the photo warped by the flow and back [h, w, 3].

    Nothing is displaced (by more than ROUND_TRIP_PX), only the interpolation acts,
    so its metrics against a render minus the photo's are what interpolation alone
    earns. Where the flow has no inverse the photo's own pixel stays.
    """
    inverse_px, valid = invert(flow_px)
    back = warp(warp(photo, flow_px), inverse_px)
    return np.where(valid[..., None], back, photo)


def _positions(flow_px):
    """x + flow_px(x) [h, w, 2] float32."""
    h, w = flow_px.shape[:2]
    at = np.array(flow_px, dtype=np.float32)
    at[..., 0] += np.arange(w, dtype=np.float32)
    at[..., 1] += np.arange(h, dtype=np.float32)[:, None]
    return at


def _sample(array, at, kernel):
    """array [h, w, c] at positions [h, w, 2]."""
    return cv2.remap(
        np.ascontiguousarray(array),
        at,
        None,
        KERNELS[kernel],
        # Mirrored borders never return for sides of 1 or flows of 1e30 (OpenCV 5.0).
        borderMode=cv2.BORDER_REPLICATE,
    )


def _check_sides(shape, name):
    if min(shape[:2]) < 1 or max(shape[:2]) > MAX_SIDE_PX:
        raise ValueError(
            f"{name} of {shape[1]}x{shape[0]} pixels: "
            f"sides must be from 1 to {MAX_SIDE_PX}"
        )
