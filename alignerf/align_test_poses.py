"""Fair scores where poses move: `python -m alignerf.align_test_poses`.

A test view's camera is as wrong as the training views' were, and no model can know by
how much. So each test camera is moved until the render fits the photo, on one half of
the pixels, and the other half is rendered with it. The halves are the squares of a
checkerboard. Nearly no pixel moves the camera that it is rendered by: a flow is smooth,
so the margins of the squares are left out of the fit, and the overfit measures what
still gets across. Writes folders of <view>.png, of both halves:

aligned_pose            moved by the flow from the render to the photo
aligned_pose_overfit    moved to fit the oracle instead of the photo: what this gains
                        against the oracle, the fit gains by itself

and poses.csv, with the motion that each half was rendered with, how many pixels it was
fitted to (none: the camera stayed), what of the flow no camera explains, and the
camera's standard error. `alignerf.evaluate` leaves out views where that is too large.
"""

import csv
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from alignerf import testsets
from alignerf.io import archives, atomic, faults, images, machine, progress
from alignerf.processes import devices
from alignerf.scenes import prepared
from alignerf.sfm import pose_error
from alignerf.training import renderer
from flow.camera import certainty
from flow.camera import fit as camera_fit
from flow.camera import motion as camera_motion
from flow.warping import controls, files

COLUMNS = (
    *("view", "test_set", "half", "rotation_deg", "centre", "length_px"),
    *("fitted_pixels", "noise_px", "error_px"),
)
# Along the smaller side of an image; and the margin that the fit leaves out, of a
# square's side.
SQUARES, MARGIN = 4, 0.25


class Fitted(NamedTuple):
    """The camera [3, 4] of a half, the number of pixels fitted, and the noise left.

    error_px: of `certainty.error_px`, in the half; NaN where it is unknown.
    """

    pose: np.ndarray
    pixels: int
    noise_px: float
    error_px: float


OPTIONS = {
    "config": "job as JSON, or its file",
    "scene": "prepared scene folder",
    "[cameras]": "cameras.npz (default: the scene's)",
    "model": "trained parameters",
    "renders": ("of the test views, by their given cameras", Path),
    "flow": ("to the photos", Path),
    "depth": ("of the renders", Path),
    "[truth]": ("folder of the oracle", Path),
    "[truth-flow]": ("to it: the overfit", Path),
    "out": ("folder, written", Path),
    "[threads]": faults.THREADS,
    "[gpus]": faults.GPUS,
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    devices.begin(args.threads, args.gpus)
    loaded = prepared.load(args.scene, args.cameras)
    method, params = renderer.read_model(args.config, args.model, loaded)
    size = loaded.width, loaded.height
    render = renderer.make_renderer(method, params, *size)
    block_px = max(1, min(size) // SQUARES)
    halves = halves_of(loaded, block_px)
    margin_px = int(MARGIN * block_px)
    by_needs = {"": (args.flow, loaded.folder / "images")}
    if args.truth and args.truth_flow:
        by_needs["truth"] = args.truth_flow, args.truth / "oracle"
    moved = [one for one in testsets.every() if one.moved and one.needs in by_needs]
    todo = [(view, one) for one in moved for view in loaded.views("test")]
    rows = []
    with ExitStack() as stack:
        out = stack.enter_context(atomic.replace_folder(args.out))
        for test_set in moved:
            (out / test_set.name).mkdir()
        bar = progress.Progress("align test poses", len(todo), unit="view")
        stack.callback(bar.close)

        def one(work):
            view, test_set = work
            flow, target = by_needs[test_set.needs]
            pair = [
                prepared.read_images(loaded, [view], folder)[0]
                for folder in (args.renders, target)
            ]
            fits = [
                fit(loaded, args.depth, margin_px, view, flow, half, pair)
                for half in halves
            ]
            poses = [fitted.pose for fitted in fits]
            name = loaded.names[view]
            image = render_halves(render, loaded, view, halves, poses)
            images.write(out / test_set.name / f"{name}.png", image)
            labels = {"view": name, "test_set": test_set.name}
            return [
                labels | {"half": number} | row(loaded, args.depth, view, fitted)
                for number, fitted in enumerate(fits)
            ]

        # The first one alone: it compiles.
        rows += one(todo[0])
        bar.advance()
        for rows_of_view in machine.map_in_threads(one, todo[1:]):
            rows += rows_of_view
            bar.advance()
        with open(out / "poses.csv", "w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, COLUMNS)
            table.writeheader()
            table.writerows(rows)


def render_halves(render, loaded: prepared.Scene, view, halves, poses):
    """The view [h, w, 3], each half by its own camera."""
    image = np.zeros((loaded.height, loaded.width, 3), np.uint8)
    for half, pose in zip(halves, poses, strict=True):
        image[half] = render(loaded.pixtocams[view], pose, half)[0][half]
    return image


def halves_of(loaded: prepared.Scene, block_px):
    """Masks [h, w] of the two halves."""
    half = controls.checkerboard(loaded.height, loaded.width, block_px=block_px)
    if half.all() or not half.any():
        raise ValueError(f"{loaded.width}x{loaded.height} pixels have no two halves")
    return half, ~half


def fit(loaded: prepared.Scene, depth, margin_px, view, flow, half, pair):
    """The pose of a half, `Fitted` to the flow of the other; unchanged by few pixels.

    pair: the render by the given camera, and the image that the flow leads to.
    """
    name = f"{loaded.names[view]}.npz"
    flow_px, valid = files.read_flow(flow / name)
    if valid.shape != (loaded.height, loaded.width):
        raise ValueError(f"{flow / name}: {valid.shape} is not the views' size")
    # A lens is the scene's: no view has a focal length of its own.
    camera = loaded.pixtocams[view], loaded.camtoworlds[view]
    depths = depth_of(depth, name)
    usable = valid & within(~half, margin_px)
    found = camera_fit.split(flow_px, usable, camera[0], depths, log_focal=0.0)
    pose = camera_motion.apply(found.motion, *camera)[1]
    points = camera_motion.points_of(camera[0], depths)
    error_px = certainty.error_px(*pair, found.motion, points, found.valid, half)
    return Fitted(pose, found.pixels, found.noise_px, error_px)


def within(mask, margin_px):
    """The mask without a margin along its edges."""
    if margin_px == 0:
        return mask
    # The image's own border is no edge of a square.
    return ndimage.binary_erosion(mask, iterations=margin_px, border_value=1)


def depth_of(folder, name):
    return archives.read(folder / name, ["depth"])["depth"]


def row(loaded: prepared.Scene, depth, view, fitted: Fitted):
    """A line of poses.csv: how far the camera has moved."""
    camera = loaded.pixtocams[view], loaded.camtoworlds[view]
    depths = depth_of(depth, f"{loaded.names[view]}.npz")
    known = depths[np.isfinite(depths) & (depths > 0)]
    near = float(np.median(known)) if len(known) else 1.0
    size, moved = (loaded.width, loaded.height), (camera[0], fitted.pose)
    return {
        **pose_error.difference(camera, moved, size, near),
        "fitted_pixels": fitted.pixels,
        "noise_px": fitted.noise_px,
        # As tables have it: an empty cell is unknown.
        "error_px": fitted.error_px if np.isfinite(fitted.error_px) else "",
    }


if __name__ == "__main__":
    faults.run(main)
