"""Write the control sets of a warped test set: they measure the gain without alignment.

Beside the warped photos, for each view:

control        the photo warped by the flow and back: only interpolation acts
placebo        the photo warped by a random smooth flow of at most half a pixel
crossfit       the photo warped by a flow that has not seen the pixel it warps
aligned        an image that belongs where the render is: the oracle, or a copy of
               the render made as sharp and as different as the photo
overfit        that image warped by the flow invented between it and the render
overfit_crossfit
               that image warped by a held-out flow: what is displaced in truth

overfit_flow holds the invented flow, and overfit.csv its lengths.

    python -m flow.control_sets --renders DIR --photos DIR --flow DIR --out DIR
        [--truth DIR]
"""

import argparse
import functools
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from alignerf.files import atomic, faults, images, machine, progress
from flow.estimation import arguments as arguments_of_flow
from flow.estimation import estimate, pairs
from flow.warping import controls, files, lengths, warp

IMAGES = ("control", "placebo", "crossfit", "aligned", "overfit", "overfit_crossfit")


def main(renders, photos, flow, out, *, truth=None, masks=None, **options):
    """Write all control sets into the folder `out`; returns the rows of overfit.csv.

    renders, photos: folders of <view>.png; flow: of <view>.npz, as the warped set
    has it; truth: a folder whose `oracle` holds an aligned image for each view;
    masks: as of `files.masked_photo`.
    options: those of `write_view`. Sets appear together or not at all. Raises
    ValueError or OSError.
    """
    views = pairs.find_pairs(Path(renders), Path(photos))
    flows = {path.stem for path in Path(flow).glob("*.npz")}
    if missing := flows - {view for view, *_ in views}:
        raise ValueError(f"{renders}: no render of view {min(missing)}")
    with ExitStack() as stack:
        # Entered first, so in place last: the CSV says that the folders are whole.
        table = stack.enter_context(atomic.replace_file(Path(out) / "overfit.csv"))
        folders = {}
        for kind in (*IMAGES, "overfit_flow"):
            place = atomic.replace_folder(Path(out) / kind)
            folders[kind] = stack.enter_context(place)

        def row_of(one):
            view, *paths = one
            started = time.perf_counter()
            render, photo = map(images.read, paths)
            photo, _ = files.masked_photo(view, render, photo, masks)
            flow_px, _ = files.read_flow(Path(flow) / f"{view}.npz")
            oracle = None
            if truth is not None:
                oracle = images.read(Path(truth) / "oracle" / f"{view}.png")
            try:
                row = write_view(
                    view, render, photo, flow_px, folders, oracle=oracle, **options
                )
            except ValueError as error:
                raise ValueError(f"view {view}: {error}") from error
            return row | {"time_s": round(time.perf_counter() - started, 4)}

        made = machine.map_in_threads(row_of, views)
        rows = list(progress.over(made, "controls", total=len(views)))
        files.write_rows(table, controls.COLUMNS, rows)
    return rows


def write_view(
    view,
    render,
    photo,
    flow_px,
    folders,
    *,
    oracle=None,
    kernel="lanczos",
    tolerance_px=1.0,
    **options,
):
    """Write one view's control sets; returns the statistics of the invented flow.

    options: method, match_blur, blur_by, of both flows; tolerance_px: of what is valid.
    """
    crossfit_px = crossfit_flow(render, photo, **options)
    if (aligned := oracle) is None:
        aligned = controls.resharpened(render, photo, crossfit_px)
    overfit_px, valid, sigma_px = pairs.flow_and_validity(
        render, aligned, tolerance_px=tolerance_px, **options
    )
    warped = functools.partial(warp.warp, kernel=kernel)
    made = {
        "control": warp.round_trip(photo, flow_px, kernel=kernel),
        "placebo": warped(photo, controls.placebo_flow(*render.shape[:2], view=view)),
        "crossfit": warped(photo, crossfit_px),
        "aligned": aligned,
        "overfit": warped(aligned, overfit_px),
        "overfit_crossfit": warped(aligned, crossfit_flow(render, aligned, **options)),
    }
    for kind, image in made.items():
        images.write(folders[kind] / f"{view}.png", image)
    files.write_flow(folders["overfit_flow"] / f"{view}.npz", overfit_px, valid)
    return {
        "view": view,
        "aligned": "resharpened" if oracle is None else "oracle",
        **lengths.statistics(overfit_px, valid, view=view),
        "blur_sigma_px": sigma_px,
    }


def crossfit_flow(
    render, photo, *, method=estimate.DEFAULT, match_blur=True, blur_by=None
):
    """`controls.crossfit_flow` with the estimator and blur that the warped set has.

    One blur for the whole image: it is a single number, and says nothing of a pixel.
    """
    if match_blur:
        photo, _ = estimate.blur_match(photo, render, method=method, blur_by=blur_by)
    flow_of = functools.partial(estimate.estimate, method=method)
    return controls.crossfit_flow(render, photo, flow_of=flow_of)


def parse(arguments=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog="flow.control_sets",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    for name in ("renders", "photos", "flow", "out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--truth", type=Path, help="folder with the oracle's images")
    parser.add_argument("--masks", type=Path, help="where photos count, if it is there")
    arguments_of_flow.add(parser)
    return parser.parse_args(arguments)


def run(arguments=None):
    """The command line; returns its exit code."""
    return faults.exit_code(main, **vars(parse(arguments)))


if __name__ == "__main__":
    sys.exit(run())
