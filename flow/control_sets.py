"""Write the control sets of a warped test set: they measure the gain without alignment.

They are the test sets of `alignerf.testsets` that have a `draw`, a folder each beside
the warped photos. overfit_flow holds the flow that the estimator invents between a
render and an image that belongs there, and overfit.csv its lengths.

    python -m flow.control_sets --renders DIR --photos DIR --flow DIR --out DIR
        [--truth DIR]

With --lengths CSV instead of --out only these lengths are written, of some views; the
image that belongs there is then made by the given flow, which has seen each pixel.
"""

import functools
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from alignerf import testsets
from alignerf.io import atomic, faults, images, machine, progress
from flow.estimation import estimate
from flow.warping import controls, files, warp

# Views with --lengths, from the first by name to the last.
MAX_VIEWS = 8
# Written by this command for the invented flow; all other folders hold images.
INVENTED = "overfit_flow"


def main(
    renders,
    photos,
    flow,
    *,
    out=None,
    lengths=None,
    truth=None,
    masks=None,
    threads=None,
    **options,
):
    """Write all control sets into the folder `out`, or `lengths`; returns the rows.

    renders, photos: folders of <view>.png; flow: of <view>.npz, as the warped set
    has it; truth: a folder whose `oracle` holds an aligned image for each view;
    masks: as of `files.masked_photo`. options: those of `View`. Sets appear together or
    not at all. Raises ValueError or OSError.
    """
    if (out is None) == (lengths is None):
        raise ValueError("either --out or --lengths")
    views = estimate.find_pairs(Path(renders), Path(photos))
    flows = {path.stem for path in Path(flow).glob("*.npz")}
    if (missing := flows - {view for view, *_ in views}) and out:
        raise ValueError(f"{renders}: no render of view {min(missing)}")
    if lengths:
        count = min(MAX_VIEWS, len(views))
        views = [views[i * (len(views) - 1) // max(count - 1, 1)] for i in range(count)]
    with ExitStack() as stack:
        # Entered first, so in place last: the CSV says that the folders are whole.
        csv = lengths or Path(out) / "overfit.csv"
        table = stack.enter_context(atomic.replace_file(csv))
        folders = {
            name: stack.enter_context(atomic.replace_folder(Path(out) / name))
            for name in testsets.image_folders()
            if not lengths
        }

        def row_of(one):
            name, *paths = one
            started = time.perf_counter()
            render, photo = map(images.read, paths)
            photo, _ = files.masked_photo(name, render, photo, masks)
            flow_px, _ = files.read_flow(Path(flow) / f"{name}.npz")
            oracle = truth and images.read(Path(truth) / "oracle" / f"{name}.png")
            view = View(name, render, photo, flow_px, oracle, **options)
            try:
                if lengths:
                    view.crossfit_px = flow_px
                else:
                    view.write(folders)
                row = view.row()
            except ValueError as error:
                raise ValueError(f"view {name}: {error}") from error
            return row | {"time_s": round(time.perf_counter() - started, 4)}

        made = machine.map_in_threads(row_of, views, threads=threads)
        rows = list(progress.over(made, "controls", total=len(views)))
        files.write_rows(table, controls.COLUMNS, rows)
    return rows


class View:
    """A view, and the flows and images that its control sets are drawn from.

    Images are [h, w, 3] uint8, flows [h, w, 2] from render to photo in pixels.
    tolerance_px: of what is valid; options: method, match_blur,
    blur_by, of all flows.
    """

    def __init__(
        self,
        name,
        render,
        photo,
        flow_px,
        oracle=None,
        *,
        tolerance_px=1.0,
        **options,
    ):
        self.name, self.render, self.photo, self.flow_px = name, render, photo, flow_px
        self.oracle, self.tolerance_px = oracle, tolerance_px
        self.options = options

    def warp(self, image, flow_px):
        """An image warped by a flow."""
        return warp.warp(image, flow_px)

    def round_trip(self):
        """The photo warped by its flow, and back by the flow's inverse."""
        return warp.round_trip(self.photo, self.flow_px)

    def placebo_px(self):
        """A flow that aligns nothing."""
        return controls.placebo_flow(*self.render.shape[:2], view=self.name)

    @functools.cached_property
    def crossfit_px(self):
        """The flow to the photo that at no pixel has seen the render there."""
        return self.held_out_px(self.photo)

    @functools.cached_property
    def aligned(self):
        """The image that belongs where the render is."""
        if self.oracle is not None:
            return self.oracle
        return controls.resharpened(self.render, self.photo, self.crossfit_px)

    @functools.cached_property
    def invented(self):
        """(flow, valid [h, w], blur in px) that an estimator finds to that image."""
        return estimate.flow_and_validity(
            self.render, self.aligned, tolerance_px=self.tolerance_px, **self.options
        )

    @property
    def invented_px(self):
        """That flow."""
        return self.invented[0]

    def held_out_px(self, image):
        """`controls.crossfit_flow` with the estimator and blur of the warped set.

        One blur for the whole image: it is a single number, and says nothing of a
        pixel.
        """
        method = self.options.get("method", estimate.DEFAULT)
        if self.options.get("match_blur", True):
            by = self.options.get("blur_by")
            image, _ = estimate.blur_match(
                image, self.render, method=method, blur_by=by
            )
        flow_of = functools.partial(estimate.estimate, method=method)
        return controls.crossfit_flow(self.render, image, flow_of=flow_of)

    def write(self, folders):
        """Write its control sets."""
        for one in testsets.drawn():
            images.write(folders[one.name] / f"{self.name}.png", one.draw(self))
        files.write_flow(folders[INVENTED] / f"{self.name}.npz", *self.invented[:2])

    def row(self):
        """The statistics of the invented flow."""
        flow_px, valid, sigma_px = self.invented
        return {
            "view": self.name,
            "aligned": "resharpened" if self.oracle is None else "oracle",
            **files.statistics(flow_px, valid, view=self.name),
            "blur_sigma_px": sigma_px,
        }


OPTIONS = {
    "renders": ("folder of <view>.png", Path),
    "photos": ("folder of <view>.png", Path),
    "flow": ("of <view>.npz, as the warped set has it", Path),
    "[out]": ("folder, written into", Path),
    "[lengths]": ("CSV, written alone", Path),
    "[truth]": ("folder with the oracle's images", Path),
    "[masks]": ("where photos count, if it is there", Path),
    "[threads]": ("views at once", int),
    **estimate.OPTIONS,
}


def run(arguments=None):
    """The command line; returns its exit code."""
    options = faults.arguments(arguments, __doc__, OPTIONS)
    return faults.exit_code(main, **vars(options))


if __name__ == "__main__":
    sys.exit(run())
