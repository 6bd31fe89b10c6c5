"""Score the renders of one trained method: `python -m alignerf.evaluate`.

One row per test view and test set. Test sets:

standard        the photo
standard_valid  the photo, on the pixels where the warped photo is valid
warped          the photo warped onto the reference model's render, valid pixels
control         the photo warped there and back: only interpolation acts
placebo         the photo warped by a random smooth flow of at most half a pixel
held_out        the photo warped by a flow that has not seen the pixel, valid pixels
aligned         an image that belongs where the reference model's render is
leak            that one warped by the flow invented between the two, where valid
leak_held_out   that one warped by a flow that has not seen the pixel, same pixels
oracle          the undisplaced scene at the given pose, where the truth is known

Those between standard and oracle are scored where a warped test set is given. Only
sets on the same pixels compare: standard, control, placebo and oracle on all;
standard_valid, warped and held_out; aligned, leak and leak_held_out. A metric that
cannot be had is empty, and `note` says why.
"""

import argparse
import pathlib

import jax.numpy as jnp
import numpy as np
import pandas as pd

from alignerf import cli, lpips, metrics, scene

METRICS = ("psnr_db", "ssim", "lpips_alex")
COLUMNS = ("view", "test_set", *METRICS, "valid_share", "note")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--renders", required=True, help="renders of the test views")
    parser.add_argument("--testset", help="folder of the warped test set")
    parser.add_argument("--truth", help="folder of the oracle, where it is known")
    parser.add_argument("--lpips-alex", help="weights of LPIPS' AlexNet, .npz")
    parser.add_argument("--metrics", required=True, help="CSV, written")
    args = parser.parse_args(argv)
    loaded = scene.load(args.scene)
    views = loaded.views("test")
    lpips_alex, lpips_note = load_lpips(args.lpips_alex)
    rows = []
    # View by view: the test sets of all views together may not fit into memory.
    for view in views:
        (render,) = scene.read_images(loaded, [view], args.renders)
        targets = targets_of(loaded, view, args.testset, args.truth)
        for test_set, (image, mask) in targets.items():
            row = score(image, render, mask, lpips_alex)
            note = "; ".join(n for n in (row.pop("note"), lpips_note) if n)
            name = {"view": loaded.names[view], "test_set": test_set}
            rows.append(name | row | {"note": note})
    with cli.replace_file(args.metrics) as path:
        pd.DataFrame(rows, columns=COLUMNS).to_csv(path, index=False)


def targets_of(loaded, view, testset, truth):
    """{test set: (image [h, w, 3], mask of its valid pixels [h, w])} of one view."""

    def read(folder):
        return scene.read_images(loaded, [view], folder)[0]

    photo = read(loaded.folder / "images")
    everywhere = np.ones(photo.shape[:2], bool)
    targets = {"standard": (photo, everywhere)}
    if testset:
        folder = pathlib.Path(testset)
        (valid,) = scene.read_validity(loaded, [view], folder / "flow")
        (leak_valid,) = scene.read_validity(loaded, [view], folder / "leak_flow")
        masks = {
            "warped": valid,
            "control": everywhere,
            "placebo": everywhere,
            "held_out": valid,
            "aligned": leak_valid,
            "leak": leak_valid,
            "leak_held_out": leak_valid,
        }
        targets["standard_valid"] = (photo, valid)
        targets |= {name: (read(folder / name), mask) for name, mask in masks.items()}
    if truth:
        targets["oracle"] = (read(pathlib.Path(truth) / "oracle"), everywhere)
    return targets


def load_lpips(path):
    """(distance of two images or None, why there is none)."""
    if path is None:
        return None, "lpips_alex: no weights given"
    weights = lpips.read_alex(path)

    def distance(first, second):
        pair = [jnp.asarray(x[None] / 255.0, jnp.float32) for x in (first, second)]
        return float(lpips.lpips_alex(weights, *pair)[0])

    return distance, ""


def score(target, render, valid, lpips_alex):
    """Metrics of one view against one target; a missing one is NaN with a note."""
    row = {"psnr_db": metrics.psnr_db(target, render, valid)}
    notes = []
    if np.isinf(row["psnr_db"]):
        # Never averaged: one such view would make every mean infinite.
        row["psnr_db"] = np.nan
        notes.append("psnr_db: identical images")
    try:
        row["ssim"] = metrics.ssim(target, render, valid)
    except ValueError as error:
        row["ssim"] = np.nan
        notes.append(f"ssim: {error}")
    row["lpips_alex"] = np.nan
    if lpips_alex is not None:
        if min(target.shape[:2]) < lpips.SMALLEST_PX:
            notes.append(f"lpips_alex: under {lpips.SMALLEST_PX} pixels")
        else:
            filled = metrics.fill_invalid(target, render, valid)
            row["lpips_alex"] = lpips_alex(filled, render)
    row["valid_share"] = float(valid.mean())
    return row | {"note": "; ".join(notes)}


if __name__ == "__main__":
    cli.run(main)
