"""What the figures share: colours of flows on one scale, their wheel, saving.

Notation: a flow is (flow_px [h, w, 2], valid [h, w]), in pixels.
"""

import numpy as np

from alignerf.files import atomic
from flow.figures import colour_wheel

# One scale for all flows of a figure, this percentile of their lengths.
SCALE_PERCENTILE = 98
WHEEL_PX = 201
# Legible where a figure is shrunk to the width of a page.
FONT_SIZE = 8
DPI = 150


def flow_scale(flows):
    """Length in pixels at the wheel's rim, at least a tenth."""
    lengths = [np.linalg.norm(flow_px[valid], axis=-1) for flow_px, valid in flows]
    # Where no flow is valid, that least.
    longest = np.percentile(np.concatenate([*lengths, [0.0]]), SCALE_PERCENTILE)
    return max(0.1, round(float(longest), 1))


def median_px(flow):
    flow_px, valid = flow
    return np.median(np.linalg.norm(flow_px[valid], axis=-1))


def draw_wheel(axes, scale_px):
    axes.imshow(colour_wheel.legend(WHEEL_PX))
    axes.set_title(f"flow, rim = {scale_px:.1f} px", fontsize=FONT_SIZE)


def draw_legend(figure, scale_px, note):
    """The wheel, and beside it what a figure's colours and numbers mean."""
    wheel, text = figure.subplots(1, 2, width_ratios=[1, 3])
    draw_wheel(wheel, scale_px)
    text.text(0, 0.5, note, fontsize=FONT_SIZE - 1, va="center")


def coloured(flow, scale_px):
    """Middlebury's code of a flow; black where it is not valid."""
    flow_px, valid = flow
    return colour_wheel.encode(flow_px, scale_px=scale_px, valid=valid)


def save_images(figure, path, *, dpi=DPI):
    """Save a figure of images, without axes."""
    for axis in figure.axes:
        axis.set_axis_off()
    save(figure, path, dpi=dpi)


def save(figure, path, *, dpi=DPI):
    with atomic.replace_file(path) as temporary:
        figure.savefig(temporary, dpi=dpi)
