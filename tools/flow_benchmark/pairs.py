"""Image pairs with a known flow, for `tools.flow_benchmark`.

Notation: a pair is render and photo [h, w, 3] uint8 RGB, `true_px` [h, w, 2] with
render(x) ~ photo(x + true_px(x)), and `known` [h, w], where it is so.
"""

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
import skimage.data

from alignerf.io import images
from flow.estimation import estimate
from flow.warping import files, warp

# Photographs that come inside scikit-image, and the part [y, x] taken of each: what
# is cut off is empty or out of focus.
PHOTOS = {
    "astronaut": np.s_[0:160, 140:348],
    "chelsea": np.s_[60:220, 90:298],
    "coffee": np.s_[80:240, 150:358],
}
LENGTHS_PX = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
BLURS_PX = (0.0, 1.0, 2.0, 4.0)


class Pair(NamedTuple):
    """data: the row of the table that the pair belongs to; name: which one it is."""

    data: str
    name: str
    render: np.ndarray
    photo: np.ndarray
    true_px: np.ndarray
    known: np.ndarray


def middlebury(folder):
    """The sequences <folder>/<name>/{frame10.png, frame11.png, flow10.flo}.

    Baker et al. 2011; frame11(x + flow) ~ frame10(x).
    """
    folders = sorted(path.parent for path in Path(folder).glob("*/flow10.flo"))
    if not folders:
        raise ValueError(f"{folder}: no sequence (*/flow10.flo)")
    for path in folders:
        frames = [images.read(path / f"frame1{i}.png") for i in (0, 1)]
        truth = files.read_flo(path / "flow10.flo")
        yield Pair("middlebury", path.name, *frames, *truth)


def stereo():
    """scikit-image's motorcycle: left(x, y) ~ right(x - disparity, y).

    Scharstein et al. 2014. Raises OSError where the installed scikit-image lacks the
    images and cannot fetch them.
    """
    left, right, disparity_px = skimage.data.stereo_motorcycle()
    known = np.isfinite(disparity_px)
    true_px = np.zeros((*known.shape, 2), np.float32)
    true_px[..., 0] = -np.where(known, disparity_px, 0)
    known &= warp.in_frame(true_px)
    yield Pair("stereo", "motorcycle", left, right, true_px, known)


def synthetic(photos=PHOTOS, lengths_px=LENGTHS_PX, blurs_px=BLURS_PX):
    """Photos warped by smooth random flows, the render's side blurred (or not).

    The longest flow of a pair has the length that its name tells. With a blur there
    is the pair of true flow zero too (`overfit ...`): what is found there is invented.
    """
    for seed, (name, part) in enumerate(photos.items()):
        photo = np.ascontiguousarray(getattr(skimage.data, name)()[part])
        for length_px in (0.0, *lengths_px):
            true_px = smooth_flow(photo.shape[:2], length_px, seed)
            render = warp.warp(photo, true_px)
            known = warp.in_frame(true_px)
            for sigma_px in blurs_px:
                if length_px == 0 and sigma_px == 0:
                    continue
                kind = "smooth" if length_px else "overfit"
                side = f"blurred {sigma_px:g} px" if sigma_px else "sharp"
                blurred = estimate.blur(render, sigma_px)
                what = f"{name} {length_px:g} px"
                yield Pair(f"{kind} {side}", what, blurred, photo, true_px, known)


def smooth_flow(shape, length_px, seed):
    """Random flow [h, w, 2] float32, smooth over an eighth of the shorter side."""
    noise = np.random.default_rng(seed).normal(size=(*shape, 2))
    flow_px = cv2.GaussianBlur(noise, (0, 0), min(shape) / 8)
    longest_px = np.linalg.norm(flow_px, axis=-1).max()
    return (flow_px * length_px / longest_px).astype(np.float32)


def scene(folder, renders, split="test"):
    """Renders of trained models of a scene whose truth is known, against its photos.

    folder: a scene's, with images/, images/truth/{flow, oracle}/ and, for each of
    `renders` (<method>/round<k>), renders/<split>/. All models of a round are one kind
    of data. The true flow leads from the oracle to the photo, so what a model itself
    shows in a wrong place counts as an error, for all estimators alike; so it does for
    the pairs of true flow zero (`overfit ...`), which set the oracle in the photo's
    place.
    """
    folder = Path(folder)
    for model in renders:
        paths = sorted((folder / model / "renders" / split).glob("*.png"))
        if not paths:
            raise ValueError(f"{folder / model / 'renders' / split}: no renders")
        data = f"{folder.name} {Path(model).name}"
        for path in paths:
            name = f"{model} {path.stem}"
            render = images.read(path)
            photo = images.read(folder / "images" / path.name)
            truth = folder / "images" / "truth"
            true_px, known = files.read_flow(truth / "flow" / f"{path.stem}.npz")
            known = known & warp.in_frame(true_px)
            yield Pair(data, name, render, photo, true_px, known)
            oracle = images.read(truth / "oracle" / path.name)
            nowhere = np.zeros_like(true_px), np.ones_like(known)
            yield Pair(f"overfit {data}", name, render, oracle, *nowhere)
