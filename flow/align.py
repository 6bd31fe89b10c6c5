"""Warp the photos of a folder onto the renders of another.

For each render: flow to the photo of the same name and back, where both agree, the
photo warped onto the render (if it is asked for), and the misalignment in pixels.

    python -m flow.align --renders DIR --photos DIR --flow-out DIR --stats-out CSV
        [--warped-out DIR]
"""

import argparse
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from alignerf.command import archives, faults, images, progress, whole
from flow.estimation import estimate, given, pairs
from flow.warping import files, lengths, warp

COLUMNS = ("view", *lengths.COLUMNS, "blur_sigma_px", "time_s")


def main(renders, photos, targets, stats_out, **options):
    """Align every view of a folder; returns the rows of the statistics.

    renders, photos: folders of <view>.png. targets: {"flow": folder} and, for warped
    photos, "warped". They and the CSV appear together or not at all. options: those
    of `align_view`. Raises ValueError or OSError.
    """
    found = pairs.find_pairs(Path(renders), Path(photos))
    rows = []
    with ExitStack() as stack:
        # Entered first, so in place last: the CSV says that the folders are whole.
        stats_path = stack.enter_context(whole.replace_file(stats_out))
        folders = {}
        for kind, target in targets.items():
            folders[kind] = stack.enter_context(whole.replace_folder(target))
        for view, render_path, photo_path in progress.over(found, "flow"):
            started = time.perf_counter()
            render, photo = images.read(render_path), images.read(photo_path)
            row = align_view(view, render, photo, folders, **options)
            rows.append(row | {"time_s": round(time.perf_counter() - started, 4)})
        files.write_rows(stats_path, COLUMNS, rows)
    return rows


def align_view(
    view, render, photo, folders, *, kernel="lanczos", depth=None, **options
):
    """Write one view's flow and, where `folders` has one for it, its warped photo.

    Returns its statistics. depth: folder of <view>.npz, of the render: what is hidden
    in the photo is not valid. options: those of `flow_of_view`.
    """
    try:
        flow_px, valid, sigma_px = flow_of_view(view, render, photo, **options)
        if (found := read_depth(depth, view)) is not None:
            valid &= warp.unoccluded(flow_px, found)
    except ValueError as error:
        raise ValueError(f"view {view}: {error}") from error
    row = lengths.statistics(flow_px, valid, view=view)
    files.write_flow(folders["flow"] / f"{view}.npz", flow_px, valid)
    if "warped" in folders:
        warped = warp.warp(photo, flow_px, kernel=kernel)
        images.write(folders["warped"] / f"{view}.png", warped)
    return {"view": view, **row, "blur_sigma_px": sigma_px}


def read_depth(folder, view):
    """Depth [h, w] of a render from <view>.npz of a folder; None without a folder."""
    if folder is None:
        return None
    return archives.read(Path(folder) / f"{view}.npz", ["depth"])["depth"]


def flow_of_view(
    view,
    render,
    photo,
    *,
    flows=None,
    method=estimate.DEFAULT,
    tolerance_px=1.0,
    **options,
):
    """`pairs.flow_and_validity`, or what the folder `flows` has for method `files`."""
    if method != given.METHOD:
        options |= {"method": method, "tolerance_px": tolerance_px}
        return pairs.flow_and_validity(render, photo, **options)
    estimate.check_pair(render, photo)
    size = render.shape[:2]
    found = given.flow_and_validity(flows, view, size, tolerance_px=tolerance_px)
    return *found, 0.0


def parse(arguments=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="flow.align", description=__doc__)
    for name in ("renders", "photos", "flow-out", "stats-out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--warped-out", type=Path, help="folder of warped photos")
    methods = (*estimate.METHODS, given.METHOD)
    parser.add_argument("--method", choices=methods, default=estimate.DEFAULT)
    parser.add_argument("--flows", type=Path, help="folder of flows made elsewhere")
    parser.add_argument(
        "--match-blur",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="blur the photo as the render is, for the flow only",
    )
    parser.add_argument("--depth", type=Path, help="of the renders, for occlusions")
    parser.add_argument("--kernel", choices=warp.KERNELS, default="lanczos")
    parser.add_argument("--tolerance-px", type=float, default=1.0)
    options = parser.parse_args(arguments)
    if (options.flows is None) == (options.method == given.METHOD):
        parser.error(f"--flows goes with --method {given.METHOD}, and it with --flows")
    return options


def run(arguments=None):
    """The command line; returns its exit code."""
    options = vars(parse(arguments))
    folders = {kind: options.pop(f"{kind}_out") for kind in ("flow", "warped")}
    targets = {kind: folder for kind, folder in folders.items() if folder}
    return faults.exit_code(main, targets=targets, **options)


if __name__ == "__main__":
    sys.exit(run())
