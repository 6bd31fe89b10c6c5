"""Draw a flow: photo | render | flow in colours | wheel with its scale in pixels.

python -m flow.draw --photo PNG --render PNG --flow NPZ --out PNG [--scale-px S]
"""

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np

from flow import colour_wheel, files

_WHITE = np.uint8(255)


def panel(photo, render, flow_px, valid, *, scale_px=None):
    """The strip [h, w, 3] uint8 of four equal frames.

    scale_px: length at the wheel's rim; the 95th percentile of the valid lengths,
    rounded up to a tenth, where it is None. Pixels without a valid flow are black.
    """
    if not photo.shape[:2] == render.shape[:2] == flow_px.shape[:2]:
        raise ValueError("photo, render and flow differ in size")
    if scale_px is None:
        scale_px = natural_scale(flow_px, valid)
    coded = colour_wheel.encode(flow_px, scale_px=scale_px, valid=valid)
    frames = [photo, render, coded, _scale(*photo.shape[:2], scale_px)]
    gap = np.full((photo.shape[0], max(2, photo.shape[1] // 50), 3), _WHITE)
    return np.concatenate([part for f in frames for part in (f, gap)][:-1], axis=1)


def natural_scale(flow_px, valid):
    """95th percentile of the valid lengths, up to the next 0.1 px; 0.1 at least."""
    if not valid.any():
        raise ValueError("the flow has no valid pixel to draw")
    p95_px = np.percentile(np.linalg.norm(flow_px[valid], axis=-1), 95)
    return max(0.1, float(np.ceil(10 * p95_px) / 10))


def _scale(height, width, scale_px):
    frame = np.full((height, width, 3), _WHITE)
    side = int(0.7 * min(height, width))
    top, left = (height - side) // 3, (width - side) // 2
    frame[top : top + side, left : left + side] = colour_wheel.legend(side)
    text, size = f"rim: {scale_px:g} px", min(height, width) / 300
    (wide, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    at = ((width - wide) // 2, height - max(4, height // 12))
    cv2.putText(
        frame, text, at, cv2.FONT_HERSHEY_SIMPLEX, size, (0, 0, 0), 1, cv2.LINE_AA
    )
    return frame


def main(photo, render, flow, out, *, scale_px=None):
    """Write the panel of one view. Raises ValueError or OSError."""
    flow_px, valid = files.read_flow(flow)
    images = files.read_image(photo), files.read_image(render)
    files.write_image(out, panel(*images, flow_px, valid, scale_px=scale_px))


def run(arguments=None):
    """The command line; returns its exit code."""
    parser = argparse.ArgumentParser(prog="flow.draw", description=__doc__)
    for name in ("photo", "render", "flow", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--scale-px", type=float, help="length at the wheel's rim")
    try:
        main(**vars(parser.parse_args(arguments)))
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(run())
