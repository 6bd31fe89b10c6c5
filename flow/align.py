"""Warp the photos of a folder onto the renders of another.

For each render: flow to the photo of the same name and back, where both agree, the
photo warped onto the render, and the misalignment in pixels.

    python -m flow.align --renders DIR --photos DIR --flow-out DIR --warped-out DIR
        --stats-out CSV
"""

import argparse
import csv
import sys
import time
from contextlib import ExitStack
from pathlib import Path

from tqdm import tqdm

from flow import displacement, estimate, files, given, warp

# Seconds between updates of the bar; a log needs few lines.
PROGRESS_S = 0.1 if sys.stderr.isatty() else 10.0

COLUMNS = (
    "view",
    "median_px",
    "mean_px",
    "p95_px",
    "valid_share",
    "blur_sigma_px",
    "time_s",
)


def main(renders, photos, targets, stats_out, *, views=None, **options):
    """Align every view of a folder; returns the rows of the statistics.

    renders, photos: folders of <view>.png. targets: {"flow": folder, "warped":
    folder} and, if asked for, "control". They and the CSV appear together or not at
    all. views: names, else every render's. options: those of `align_view`. Raises
    ValueError or OSError.
    """
    pairs = find_pairs(Path(renders), Path(photos), views)
    rows = []
    with ExitStack() as stack:
        # Entered first, so in place last: the CSV says that the folders are whole.
        stats_path = stack.enter_context(files.replacing(stats_out))
        folders = {}
        for kind, target in targets.items():
            folders[kind] = stack.enter_context(files.replacing(target))
            folders[kind].mkdir()
        for view, render_path, photo_path in tqdm(
            pairs, desc="flow", unit="view", mininterval=PROGRESS_S
        ):
            started = time.perf_counter()
            render, photo = files.read_image(render_path), files.read_image(photo_path)
            row = align_view(view, render, photo, folders, **options)
            rows.append(row | {"time_s": round(time.perf_counter() - started, 4)})
        write_rows(stats_path, rows)
    return rows


def align_view(view, render, photo, folders, *, kernel="lanczos", **options):
    """Write one view's flow, warped photo and control; returns its statistics.

    options: those of `flow_and_validity`.
    """
    try:
        flow_px, valid, sigma_px = flow_and_validity(render, photo, view, **options)
    except ValueError as error:
        raise ValueError(f"view {view}: {error}") from error
    row = displacement.statistics(flow_px, valid, view=view)
    files.write_flow(folders["flow"] / f"{view}.npz", flow_px, valid)
    warped = warp.warp(photo, flow_px, kernel=kernel)
    files.write_image(folders["warped"] / f"{view}.png", warped)
    if "control" in folders:
        control = warp.round_trip(photo, flow_px, kernel=kernel)
        files.write_image(folders["control"] / f"{view}.png", control)
    return {"view": view, **row, "blur_sigma_px": sigma_px}


def flow_and_validity(
    render,
    photo,
    view,
    *,
    method=estimate.DEFAULT,
    flows=None,
    match_blur=True,
    tolerance_px=1.0,
):
    """(flow_px [h, w, 2], valid [h, w], sigma_px of the photo's blur before the flow).

    Valid: in frame, where the flow and that from photo to render agree to
    tolerance_px. Method `files` takes the view's from the folder `flows` instead, see
    `given`; it blurs nothing.
    """
    sigma_px = 0.0
    if method == given.METHOD:
        estimate.check_pair(render, photo)
        size = render.shape[:2]
        found = given.flow_and_validity(flows, view, size, tolerance_px=tolerance_px)
        return *found, sigma_px
    if match_blur:
        photo, sigma_px = estimate.blur_match(photo, render, method=method)
    forward_px = estimate.estimate(render, photo, method=method)
    backward_px = estimate.estimate(photo, render, method=method)
    valid = warp.consistent(forward_px, backward_px, tolerance_px=tolerance_px)
    return forward_px, valid, sigma_px


def find_pairs(renders, photos, views=None):
    """[(view, render's path, photo's path)], in the order of names.

    Raises ValueError naming the first file that is missing.
    """
    for folder in (renders, photos):
        if not folder.is_dir():
            raise ValueError(f"{folder}: no such folder")
    if views is None:
        views = sorted(path.stem for path in renders.glob("*.png"))
    if not views:
        raise ValueError(f"{renders}: no renders (*.png) to align")
    pairs = [(v, renders / f"{v}.png", photos / f"{v}.png") for v in views]
    for view, render_path, photo_path in pairs:
        if not render_path.is_file():
            raise ValueError(f"{render_path}: no render for view {view}")
        if not photo_path.is_file():
            raise ValueError(f"{photo_path}: no photo for render {render_path}")
    return pairs


def read_views(path, split):
    """Names of a split's views from cameras.npz (`names` [n], `split` [n])."""
    names, splits = files.read_arrays(path, "names", "split")
    if names.shape != splits.shape or names.ndim != 1:
        raise ValueError(f"{path}: names and split do not fit each other")
    views = sorted(str(name) for name in names[splits == split])
    if not views:
        raise ValueError(f"{path}: no view in split {split!r}")
    return views


def write_rows(path, rows):
    """Write the statistics as CSV, one row per view."""
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def parse(arguments=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="flow.align", description=__doc__)
    for name in ("renders", "photos", "flow-out", "warped-out", "stats-out"):
        parser.add_argument(f"--{name}", type=Path, required=True)
    parser.add_argument("--control-out", type=Path, help="resample-only controls")
    methods = (*estimate.METHODS, given.METHOD)
    parser.add_argument("--method", choices=methods, default=estimate.DEFAULT)
    parser.add_argument("--flows", type=Path, help="folder of flows made elsewhere")
    parser.add_argument(
        "--match-blur",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="blur the photo as the render is, for the flow only",
    )
    parser.add_argument("--kernel", choices=warp.KERNELS, default="lanczos")
    parser.add_argument("--tolerance-px", type=float, default=1.0)
    parser.add_argument("--views-file", type=Path, help="cameras.npz")
    parser.add_argument("--split", choices=("train", "test"))
    options = parser.parse_args(arguments)
    if (options.views_file is None) != (options.split is None):
        parser.error("--views-file and --split go together")
    if (options.flows is None) == (options.method == given.METHOD):
        parser.error(f"--flows goes with --method {given.METHOD}, and it with --flows")
    return options


def run(arguments=None):
    """The command line; returns its exit code."""
    options = vars(parse(arguments))
    views_file, split = options.pop("views_file"), options.pop("split")
    targets = {
        kind: options.pop(f"{kind}_out") for kind in ("flow", "warped", "control")
    }
    targets = {kind: path for kind, path in targets.items() if path is not None}
    try:
        views = None if views_file is None else read_views(views_file, split)
        main(targets=targets, views=views, **options)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(run())
