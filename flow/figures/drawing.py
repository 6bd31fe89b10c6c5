"""What the figures share: colours of flows on one scale, their wheel, saving.

Notation: a flow is (flow_px [h, w, 2], valid [h, w]), in pixels.
Colours are Middlebury's: hue is the direction, saturation the length (Baker et al.
2011, "A Database and Evaluation Methodology for Optical Flow").
`scale_px` is the length that is fully saturated.
"""

import numpy as np

from alignerf.io import atomic

# One scale for all flows of a figure, this percentile of their lengths.
SCALE_PERCENTILE = 98
WHEEL_PX = 201
# Legible where a figure is shrunk to the width of a page.
FONT_SIZE = 8
DPI = 150
# Steps from one corner of the RGB cube to the next, more where the eye sees more:
# red - yellow - green - cyan - blue - magenta - red.
_STEPS = (15, 6, 4, 11, 13, 6)
_CORNERS = np.array(
    [[1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1], [1, 0, 1], [1, 0, 0]],
    dtype=np.float64,
)


def _wheel():
    parts = [
        start + np.arange(steps)[:, None] / steps * (end - start)
        for steps, start, end in zip(_STEPS, _CORNERS, _CORNERS[1:], strict=False)
    ]
    return np.concatenate(parts)


WHEEL = _wheel()


def encode(flow_px, *, scale_px, valid=None):
    """Colours [h, w, 3] uint8: white is no flow, longer than scale_px is darkened.

    Pixels that are not valid, or not finite, are black.
    """
    if not (np.isfinite(scale_px) and scale_px > 0):
        raise ValueError(f"scale_px must be positive, is {scale_px}")
    flow_px = np.asarray(flow_px, dtype=np.float64)
    known = np.isfinite(flow_px).all(axis=-1)
    if valid is not None:
        known &= valid
    u, v = np.where(known[..., None], flow_px / scale_px, 0.0).transpose(2, 0, 1)
    radius = np.hypot(u, v)[..., None]
    at = (np.arctan2(-v, -u) / np.pi + 1) / 2 * (len(WHEEL) - 1)
    low = np.floor(at).astype(int)
    fraction = (at - low)[..., None]
    high = (low + 1) % len(WHEEL)
    hue = (1 - fraction) * WHEEL[low] + fraction * WHEEL[high]
    colour = np.where(radius <= 1, 1 - radius * (1 - hue), 0.75 * hue)
    return np.floor(255 * colour * known[..., None]).astype(np.uint8)


def faded(flow_px, min_px):
    """The flow with lengths beneath `min_px` shortened by their square's share.

    At the least itself nothing changes, half of it becomes an eighth: beneath what can
    be told colours fade out without an edge.
    """
    if not (np.isfinite(min_px) and min_px >= 0):
        raise ValueError(f"min_px must be 0 or more, is {min_px}")
    flow_px = np.asarray(flow_px, dtype=np.float64)
    length = np.linalg.norm(flow_px, axis=-1, keepdims=True)
    # A length that is no number stays none.
    share = np.where(length < min_px, length / max(min_px, 1e-12), 1.0)
    return flow_px * share**2


def legend(side_px, *, scale_px=1.0, min_px=0.0):
    """The wheel [side_px, side_px, 3]: colour of the flow from the centre to here.

    The rim stands for the scale; outside of it the image is white. min_px: as of
    `faded`.
    """
    offset = (np.arange(side_px) - (side_px - 1) / 2) / (side_px / 2)
    flow = np.stack(np.meshgrid(offset, offset), axis=-1)
    inside = np.hypot(flow[..., 0], flow[..., 1]) <= 1
    colours = encode(faded(flow * scale_px, min_px), scale_px=scale_px)
    return np.where(inside[..., None], colours, np.uint8(255))


def flow_scale(flows):
    """Length in pixels at the wheel's rim, at least a tenth."""
    lengths = [np.linalg.norm(flow_px[valid], axis=-1) for flow_px, valid in flows]
    # Where no flow is valid, that least.
    longest = np.percentile(np.concatenate([*lengths, [0.0]]), SCALE_PERCENTILE)
    return max(0.1, round(float(longest), 1))


def median(flow):
    """The median length of a flow, in words."""
    flow_px, valid = flow
    if not valid.any():
        return "no valid flow"
    return f"{np.median(np.linalg.norm(flow_px[valid], axis=-1)):.2f} px"


def draw_wheel(axes, scale_px):
    axes.imshow(legend(WHEEL_PX))
    axes.set_title(f"flow, rim = {scale_px:.1f} px", fontsize=FONT_SIZE)


def draw_legend(figure, scale_px, note):
    """The wheel, and beside it what a figure's colours and numbers mean."""
    wheel, text = figure.subplots(1, 2, width_ratios=[1, 3])
    draw_wheel(wheel, scale_px)
    text.text(0, 0.5, note, fontsize=FONT_SIZE - 1, va="center")


def coloured(flow, scale_px):
    """Middlebury's code of a flow; black where it is not valid."""
    flow_px, valid = flow
    return encode(flow_px, scale_px=scale_px, valid=valid)


def save_images(figure, path, *, dpi=DPI):
    """Save a figure of images, without axes."""
    for axis in figure.axes:
        axis.set_axis_off()
    save(figure, path, dpi=dpi)


def save(figure, path, *, dpi=DPI):
    with atomic.replace_file(path) as temporary:
        figure.savefig(temporary, dpi=dpi)
