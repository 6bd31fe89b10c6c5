"""Controls of a warped test set: flows and images that show what is not alignment.

Notation: images [h, w, 3] uint8 RGB; `flow_px` [h, w, 2] float32 from render to
photo, x then y in pixels; `kept` [h, w] bool, the pixels that a flow may see.
"""

import zlib

import cv2
import numpy as np

from flow.warping import files, warp

# Of overfit.csv, a row for each view.
COLUMNS = ("view", "aligned", *files.STATISTICS, "blur_sigma_px", "time_s")
# Half a pixel displaces little, and asks for every fraction that resampling can.
PLACEBO_PX = 0.5

# A render's errors are correlated over a few pixels, and reach into small blocks. Six
# renders of a scene without motion, poses exact, gained by a held-out warp onto the
# truth, where nothing is to be gained: 0.26 dB at 4 px, 0.13 at 8, 0.01 at 12, -0.01
# at 16, -0.09 at 24. Larger blocks also lose true flow that varies.
BLOCK_PX = 12

# One passage finds three quarters of a shift of 3 px: the blocks' edges, at one place
# in both images, look like no motion. Three find 95 % and more of its dB.
PASSAGES = 3


def placebo_flow(height, width, *, view, longest_px=PLACEBO_PX):
    """A random smooth flow [h, w, 2] of at most longest_px, the same for a name.

    Gaussian noise blurred by an eighth of the smaller side. A warp by it aligns
    nothing: what it does to a score, any warp does.
    """
    # A hash of the name: a view's flow does not depend on which others there are.
    rng = np.random.default_rng(zlib.crc32(view.encode()))
    noise = rng.normal(size=(height, width, 2)).astype(np.float32)
    flow_px = cv2.GaussianBlur(noise, (0, 0), max(min(height, width) / 8, 1.0))
    longest = np.linalg.norm(flow_px, axis=-1).max()
    # Just below, so that rounding cannot carry it above.
    return flow_px * np.float32(longest_px * (1 - 1e-6) / longest)


def checkerboard(height, width, *, block_px=BLOCK_PX):
    """Mask [h, w] of one half of the pixels: every second square of block_px."""
    y, x = np.indices((height, width), sparse=True)
    return (y // block_px + x // block_px) % 2 == 1


def spread(values, kept, *, sigma_px):
    """Values [h, w, c] as they are where kept, elsewhere from the kept ones alone.

    Normalised convolution (Knutsson & Westin 1993) by a Gaussian, float32. Raises
    ValueError where kept pixels are too far for it.
    """
    values = np.asarray(values, dtype=np.float32)
    weight = kept.astype(np.float32)
    # Zero times a value that is not finite would be none.
    known = np.where(kept[..., None], values, np.float32(0))
    total = cv2.GaussianBlur(weight, (0, 0), sigma_px)
    if not (total[~kept] > 0).all():
        raise ValueError("no kept pixel within reach of some held-out one")
    blurred = cv2.GaussianBlur(known, (0, 0), sigma_px)
    filled = blurred / np.maximum(total, np.finfo(np.float32).tiny)[..., None]
    return np.where(kept[..., None], values, filled)


def crossfit_flow(render, photo, *, flow_of, block_px=BLOCK_PX, passages=PASSAGES):
    """Flow [h, w, 2] that at no pixel has seen the render there.

    A checkerboard's squares are held out, half and half: in both images they are
    filled from the kept ones, flow_of(render, photo) sees the result, and the kept
    flow is spread into them. A warp by it aligns what is truly and smoothly
    displaced; what an estimator fits to noise does not carry over to pixels that it
    has not seen. The photo beside a square is seen as far as it is displaced.
    """
    kept = checkerboard(*render.shape[:2], block_px=block_px)
    if kept.all() or not kept.any():
        raise ValueError(f"images must be larger than blocks of {block_px} px")
    seen_by_half = [
        flow_of_half(
            render, photo, half, flow_of=flow_of, block_px=block_px, passages=passages
        )
        for half in (kept, ~kept)
    ]
    return np.where(kept[..., None], seen_by_half[1], seen_by_half[0])


def flow_of_half(render, photo, kept, *, flow_of, block_px, passages):
    """Flow [h, w, 2] from the kept pixels alone, spread to the others."""
    render = _fill(render, kept, block_px)
    flow_px = np.zeros((*kept.shape, 2), np.float32)
    for _ in range(passages):
        # The photo as aligned so far, so that its blocks hold what the render's hold.
        remaining_px = flow_of(render, _fill(warp.warp(photo, flow_px), kept, block_px))
        remaining_px = spread(remaining_px, kept, sigma_px=block_px / 2)
        flow_px = warp.compose(remaining_px, flow_px)
        flow_px = spread(flow_px, kept, sigma_px=block_px / 2)
    return flow_px


def resharpened(render, photo, flow_px):
    """A copy of the render, as sharp and as different as a photo, displaced nowhere.

    The render plus what the aligned photo differs in, taken from half an image away:
    detail that the render lacks and errors that it has, of true size and texture, at
    places where they match nothing. A stand-in for the oracle: an unsharp mask has
    the detail but no errors, and errors are what a flow is fitted to.
    """
    difference = warp.warp(photo, flow_px).astype(np.int16) - render
    height, width = render.shape[:2]
    elsewhere = np.roll(difference, (height // 2, width // 2), axis=(0, 1))
    return np.clip(render + elsewhere, 0, 255).astype(np.uint8)


def _fill(image, kept, block_px):
    """The image with held-out pixels from the kept ones [h, w, 3] uint8."""
    filled = spread(image, kept, sigma_px=block_px / 4)
    return np.clip(np.rint(filled), 0, 255).astype(np.uint8)
