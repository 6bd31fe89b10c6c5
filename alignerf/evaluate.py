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
oracle_moving   the same on the pixels that show what moves, in either of two states
oracle_still    the same on all others
aligned_pose    the photo, rendered by a camera moved to fit it, each half by what the
                other one asks for; `_gradient`: by gradient descent instead of flow
aligned_pose_leak, aligned_pose_gradient_leak
                the oracle, by a camera moved to fit it, which it needs not

Those between standard and oracle are scored where a warped test set is given; those
after it in a run of their own, with --aligned-pose. Only sets on the same pixels
compare: standard, control, placebo, oracle and those after it on all; standard_valid,
warped and held_out; aligned, leak and leak_held_out. A metric that cannot be had is
empty, and `note` says why; LPIPS needs weights, for each network.
"""

import argparse
import dataclasses
import pathlib

import numpy as np
import pandas as pd

from alignerf.experiment.keys import scored as scored_keys
from alignerf.files import archives, atomic, faults
from alignerf.metrics import image as image_metrics
from alignerf.scenes import prepared

NETS = [field.name for field in dataclasses.fields(scored_keys.Lpips)]
# Renders by moved cameras, and whether they are to fit the oracle.
ALIGNED_POSES = {
    "aligned_pose": False,
    "aligned_pose_leak": True,
    "aligned_pose_gradient": False,
    "aligned_pose_gradient_leak": True,
}
METRICS = ("psnr_db", "ssim", *(f"lpips_{net}" for net in NETS))
COLUMNS = ("view", "test_set", *METRICS, "valid_share", "note")


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    renders = parser.add_mutually_exclusive_group(required=True)
    renders.add_argument("--renders", help="renders of the test views")
    renders.add_argument("--aligned-pose", help="folder of renders by moved cameras")
    parser.add_argument("--testset", help="folder of the warped test set")
    parser.add_argument("--truth", help="folder of the oracle, where it is known")
    for net in NETS:
        parser.add_argument(f"--lpips-{net}", help="weights of this LPIPS, .npz")
    parser.add_argument("--metrics", required=True, help="CSV, written")
    args = parser.parse_args(argv)
    loaded = prepared.load(args.scene)
    views = loaded.views("test")
    if args.renders:
        check_renders([loaded.names[view] for view in views], args.renders)
    paths = {net: getattr(args, f"lpips_{net}") for net in NETS}
    learned = {f"lpips_{net}": load_lpips(net, p) for net, p in paths.items() if p}
    missing = ", ".join(f"lpips_{net}" for net, path in paths.items() if not path)
    missing = missing and f"{missing}: no weights given"
    rows = []
    # View by view: the test sets of all views together may not fit into memory.
    for view in views:
        targets = targets_of(loaded, view, args.testset, args.truth)
        if args.aligned_pose:
            scored = moved_renders(loaded, view, args.aligned_pose, targets)
        else:
            (render,) = prepared.read_images(loaded, [view], args.renders)
            scored = {
                name: (image, render, mask) for name, (image, mask) in targets.items()
            }
        for test_set, images in scored.items():
            row = score(*images, learned, seams=bool(args.aligned_pose))
            note = "; ".join(n for n in (row.pop("note"), missing) if n)
            name = {"view": loaded.names[view], "test_set": test_set}
            rows.append(name | row | {"note": note})
    with atomic.replace_file(args.metrics) as path:
        pd.DataFrame(rows, columns=COLUMNS).to_csv(path, index=False)


def check_renders(names, folder):
    """ValueError naming the views without a render, which external folders lack."""
    folder = pathlib.Path(folder)
    if missing := [name for name in names if not (folder / f"{name}.png").is_file()]:
        few = faults.some_names(missing)
        raise ValueError(f"{folder}: no <view>.png of {len(missing)} test views: {few}")


def targets_of(loaded, view, testset, truth):
    """{test set: (image [h, w, 3], mask of its valid pixels [h, w])} of one view."""

    def read(folder):
        return prepared.read_images(loaded, [view], folder)[0]

    photo = read(loaded.folder / "images")
    (everywhere,) = prepared.read_masks(loaded, [view])
    targets = {"standard": (photo, everywhere)}
    if testset:
        folder = pathlib.Path(testset)
        (valid,) = prepared.read_validity(loaded, [view], folder / "flow")
        (leak_valid,) = prepared.read_validity(loaded, [view], folder / "leak_flow")
        leak_valid &= everywhere
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
        oracle = read(pathlib.Path(truth) / "oracle")
        targets["oracle"] = (oracle, everywhere)
        path = pathlib.Path(truth) / "moving" / f"{loaded.names[view]}.npz"
        if path.is_file():
            moving = archives.read(path, ["moving"])["moving"]
            parts = {"oracle_moving": moving, "oracle_still": ~moving}
            targets |= {
                name: (oracle, mask) for name, mask in parts.items() if mask.any()
            }
    return targets


def moved_renders(loaded, view, folder, targets):
    """{test set: (image, render, mask)} of one view rendered by moved cameras."""
    renders = {}
    for name, to_oracle in ALIGNED_POSES.items():
        target = targets.get("oracle" if to_oracle else "standard")
        if target and (path := pathlib.Path(folder) / name).is_dir():
            (render,) = prepared.read_images(loaded, [view], path)
            renders[name] = target[0], render, target[1]
    if not renders:
        raise ValueError(f"{folder}: no renders by moved cameras")
    return renders


def load_lpips(net, path):
    """The metric of a network: (target, render, valid) to its LPIPS."""
    # JAX takes longer to import than all other scores to calculate.
    import jax.numpy as jnp

    from alignerf.metrics import lpips

    weights = lpips.read(net, path)

    def metric(target, render, valid):
        pair = (image_metrics.fill_invalid(target, render, valid), render)
        pair = [jnp.asarray(image[None] / 255.0, jnp.float32) for image in pair]
        return float(lpips.distance(net, weights, *pair)[0])

    return metric


def score(target, render, valid, learned, *, seams=False):
    """Metrics of one view against one target; a missing one is NaN with a note.

    learned: {name: metric} of those that need weights. seams: the render has some,
    which all metrics but PSNR would see in their windows; they are left out.
    """
    row = {"psnr_db": image_metrics.psnr_db(target, render, valid)}
    notes = []
    if np.isinf(row["psnr_db"]):
        # Never averaged: one such view would make every mean infinite.
        row["psnr_db"] = np.nan
        notes.append("psnr_db: identical images")
    windowed = {"ssim": image_metrics.ssim, **learned}
    if seams:
        row |= dict.fromkeys(windowed, np.nan)
        notes.append("psnr_db alone: the render has seams")
        windowed = {}
    for name, metric in windowed.items():
        try:
            row[name] = metric(target, render, valid)
        except ValueError as error:
            row[name] = np.nan
            notes.append(f"{name}: {error}")
    row["valid_share"] = float(valid.mean())
    return row | {"note": "; ".join(notes)}


if __name__ == "__main__":
    faults.run(main)
