"""Flow and warped photos of all views of a folder, and how long the flow is.

Notation: images [h, w, 3] uint8 RGB; `flow_px` [h, w, 2] float32 from render to
photo, x then y in pixels; `valid` [h, w].
"""

import time
from contextlib import ExitStack
from pathlib import Path

from alignerf.io import archives, atomic, images, machine, progress
from flow.estimation import estimate, external
from flow.warping import files, warp

COLUMNS = ("view", *files.STATISTICS, "blur_sigma_px", "time_s")


def align(renders, photos, targets, stats_out, *, threads=1, **options):
    """Align every view of a folder; returns the rows of the statistics.

    renders, photos: folders of <view>.png. targets: {"flow": folder} and, for warped
    photos, "warped". They and the CSV appear together or not at all. threads: views at
    once; each takes 0.3 GB of a view of 2 megapixels. options: those of `align_view`.
    Raises ValueError or OSError.
    """
    views = estimate.find_pairs(Path(renders), Path(photos))
    with ExitStack() as stack:
        # Entered first, so in place last: the CSV says that the folders are whole.
        stats_path = stack.enter_context(atomic.replace_file(stats_out))
        folders = {}
        for kind, target in targets.items():
            folders[kind] = stack.enter_context(atomic.replace_folder(target))

        def row_of(one):
            view, *paths = one
            started = time.perf_counter()
            render, photo = map(images.read, paths)
            row = align_view(view, render, photo, folders, **options)
            return row | {"time_s": round(time.perf_counter() - started, 4)}

        made = machine.map_in_threads(row_of, views, threads=threads)
        rows = list(progress.over(made, "flow", total=len(views)))
        files.write_rows(stats_path, COLUMNS, rows)
    return rows


def align_view(view, render, photo, folders, *, depth=None, masks=None, **options):
    """Write one view's flow and, where `folders` has one for it, its warped photo.

    Returns its statistics. Without a valid pixel the photo stays as it is. depth:
    folder of <view>.npz, of the render: what is hidden in the photo is not valid.
    masks: as of `files.masked_photo`. options: those of `flow_of_view`.
    """
    try:
        photo, counts = files.masked_photo(view, render, photo, masks)
        flow_px, valid, sigma_px = flow_of_view(view, render, photo, **options)
        if counts is not None:
            valid &= warp.sees_only(flow_px, counts)
        if (depth_map := read_depth(depth, view)) is not None:
            valid &= warp.unoccluded(flow_px, depth_map)
    except ValueError as error:
        raise ValueError(f"view {view}: {error}") from error
    row = files.statistics(flow_px, valid, view=view)
    files.write_flow(folders["flow"] / f"{view}.npz", flow_px, valid)
    if "warped" in folders:
        warped = warp.warp(photo, flow_px) if valid.any() else photo
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
    """`estimate.flow_and_validity`; of method `files`, what folder `flows` has."""
    if method != external.METHOD:
        options |= {"method": method, "tolerance_px": tolerance_px}
        return estimate.flow_and_validity(render, photo, **options)
    estimate.check_pair(render, photo)
    size = render.shape[:2]
    flow_px, valid = external.flow_and_validity(
        flows, view, size, tolerance_px=tolerance_px
    )
    return flow_px, valid, 0.0
