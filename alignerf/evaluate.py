"""Score the renders of one trained method: `python -m alignerf.evaluate`.

One row per test view and test set. What each is compared with, and on which pixels,
`alignerf.testsets` says. Those that need a warped test set, or the
truth, are scored where that is given; renders by moved cameras in a run of their own,
with --aligned-pose. Only sets on the same pixels compare. A metric that cannot be had
is empty, and `note` says why; LPIPS needs weights, for each network. So is all of a
view whose moved camera is not known to half a pixel.
"""

import functools
import pathlib

import numpy as np
import pandas as pd

from alignerf import testsets
from alignerf.io import archives, atomic, csv_files, faults
from alignerf.metrics import image as image_metrics
from alignerf.scenes import prepared
from alignerf.tables import columns

METRICS = tuple(columns.METRICS)
NETS = [name.removeprefix("lpips_") for name in columns.NETWORKS]
COLUMNS = ("view", "test_set", *METRICS, "valid_fraction", "note")
# A camera that was fitted to a photo is used up to this standard error: renders that
# are off by more lose a dB and more where there is detail.
MAX_ERROR_PX = 0.5


OPTIONS = {
    "scene": "prepared scene folder",
    "[renders]": "renders of the test views",
    "[aligned-pose]": "instead: folder of renders by moved cameras",
    "[testset]": "folder of the warped test set",
    "[truth]": "folder of the oracle, where it is known",
    **{f"[lpips-{net}]": "weights of this LPIPS, .npz" for net in NETS},
    "metrics": "CSV, written",
}


def main(argv=None):
    args = faults.arguments(argv, __doc__, OPTIONS)
    if (args.renders is None) == (args.aligned_pose is None):
        raise ValueError("either --renders or --aligned-pose")
    loaded = prepared.load(args.scene)
    views = loaded.views("test")
    paths = {net: getattr(args, f"lpips_{net}") for net in NETS}
    learned = image_metrics.learned(paths)
    missing = ", ".join(f"lpips_{net}" for net, path in paths.items() if not path)
    missing = missing and f"{missing}: no weights given"
    errors_px = args.aligned_pose and errors_of(args.aligned_pose)
    rows = []
    # View by view: the test sets of all views together may not fit into memory.
    for view in views:
        seen = View(loaded, view, args.testset, args.truth)
        found = list(pairs_of(seen, args.renders, args.aligned_pose))
        if not found:
            raise ValueError(f"{args.aligned_pose}: no renders by moved cameras")
        for test_set, *images in found:
            row = score(*images, learned, seams=bool(args.aligned_pose))
            name = {"view": loaded.names[view], "test_set": test_set}
            error_px = errors_px.get((*name.values(),), np.inf) if errors_px else 0
            if error_px > MAX_ERROR_PX:
                why = f"psnr_db: the photo leaves its camera open by {error_px:.2g} px"
                row |= {"psnr_db": np.nan, "note": why.removesuffix(" by inf px")}
            note = "; ".join(n for n in (row.pop("note"), missing) if n)
            rows.append(name | row | {"note": note})
    with atomic.replace_file(args.metrics) as path:
        pd.DataFrame(rows, columns=COLUMNS).to_csv(path, index=False)


class View:
    """A test view, and what its renders may be compared with; each is read if asked.

    Images are [h, w, 3] uint8, masks [h, w] bool.
    """

    def __init__(self, loaded, view, testset=None, truth=None):
        self.loaded, self.view = loaded, view
        self.testset = testset and pathlib.Path(testset)
        self.truth = truth and pathlib.Path(truth)

    def read(self, folder):
        """The view's image in a folder."""
        return prepared.read_images(self.loaded, [self.view], folder)[0]

    def of_testset(self, name):
        """The view's image in a folder of the warped test set."""
        return self.read(self.testset / name)

    @property
    def has(self):
        """What a test set may need that is there."""
        parts = {"": True, "testset": self.testset, "truth": self.truth}
        parts["moving"] = self.truth and self.moving_path.is_file()
        return {name for name, is_there in parts.items() if is_there}

    @functools.cached_property
    def photo(self):
        return self.read(self.loaded.folder / "images")

    @functools.cached_property
    def oracle(self):
        return self.read(self.truth / "oracle")

    @functools.cached_property
    def everywhere(self):
        """Where the photo counts."""
        return prepared.read_masks(self.loaded, [self.view])[0]

    @functools.cached_property
    def valid(self):
        """Where the flow of the warped test set is valid."""
        return self.validity("flow")

    @functools.cached_property
    def overfit_valid(self):
        """Where the invented flow is valid, and the photo counts."""
        return self.validity("overfit_flow") & self.everywhere

    def validity(self, name):
        folder = self.testset / name
        return prepared.read_validity(self.loaded, [self.view], folder)[0]

    @property
    def moving_path(self):
        return self.truth / "moving" / f"{self.loaded.names[self.view]}.npz"

    @functools.cached_property
    def moving(self):
        """Where an object is seen that moves, in either of its states."""
        return archives.read(self.moving_path, ["moving"])["moving"]

    @property
    def still(self):
        """Where none is."""
        return ~self.moving


def pairs_of(view, renders, moved):
    """(test set, image, render, mask of pixels) of all that a view is scored on.

    renders: the folder of a model's renders; moved: that of folders of renders by moved
    cameras, which are scored alone.
    """
    read = functools.cache(view.read)
    for one in testsets.every():
        folder = pathlib.Path(moved) / one.name if moved else renders
        if one.needs not in view.has or one.moved != bool(moved):
            continue
        if moved and not folder.is_dir():
            continue
        image, mask = one.make(view)
        if image.shape != view.photo.shape or mask.shape != image.shape[:2]:
            raise ValueError(f"test set {one.name}: not of the photo's size")
        # Of a view in which nothing moves, nothing is to be seen of what does.
        if one.needs != "moving" or mask.any():
            yield one.name, image, read(folder), mask


def errors_of(folder):
    """{(view, test set): the larger of its halves' error_px}, unknown ones infinite."""
    keys = ["view", "test_set"]
    path = pathlib.Path(folder) / "poses.csv"
    table = csv_files.read(path, columns=(*keys, "error_px")).fillna(np.inf)
    return table.groupby(keys)["error_px"].max().to_dict()


def score(target, render, valid, learned, *, seams=False):
    """Metrics of one view against one target; a missing one is NaN with a note.

    learned: {name: metric} of those that need weights. seams: the render has some,
    which all metrics but PSNR would see in their windows; they are left out.
    """
    if not valid.any():
        empty = dict.fromkeys(("psnr_db", "ssim", *learned), np.nan)
        return empty | {"valid_fraction": 0.0, "note": "no valid pixel"}
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
    row["valid_fraction"] = float(valid.mean())
    return row | {"note": "; ".join(notes)}


if __name__ == "__main__":
    faults.run(main)
