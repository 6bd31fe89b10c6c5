"""Split each view's misalignment into its causes: `python -m flow.decompose`.

The camera part of a flow is what a small motion and a zoom of the view's camera
explain, given the rendered depth. The remainder holds moving objects, bends of the
model, which averages misaligned photos, errors of the flow, and occlusion. Where the
truth is known, the model's part, the flow from the render to the oracle of the same
view, is taken off first. Writes <view>.npz with the parts, and statistics.

    python -m flow.decompose --renders-depth DIR --flow DIR --cameras cameras.npz
        --split test --out-flow DIR --stats-out CSV
        [--model-flow DIR]
"""

import sys
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from alignerf.io import archives, atomic, faults, machine
from flow.camera import fit as camera_fit
from flow.warping import files

# Lengths beyond this percentile of the flow's count as that: a single wild vector
# must not outweigh a view.
CAP_PERCENTILE = 99
# Of views without any: what they lack, and what to ask.
NO_DEPTH = (
    "both a valid flow and a depth",
    "the render shows nothing of the photo; train longer, or another model",
)
PARTS = ("flow", "model", "camera", "remainder")
COLUMNS = (
    "view",
    "valid_fraction",
    *(f"{part}_{length}" for part in PARTS for length in files.LENGTHS),
    "camera_fraction",
    "moved_fraction",
    "moved_mean_px",
    "noise_px",
    *(f"rotation_{axis}_deg" for axis in "xyz"),
    *(f"centre_{axis}" for axis in "xyz"),
    "focal_ratio",
    "fitted_pixels",
    "time_s",
)


def main(
    renders_depth,
    flow,
    cameras,
    split,
    out_flow,
    stats_out,
    model_flow=None,
    threads=1,
):
    """Decompose the flow of every view of a split; returns the statistics' rows.

    renders_depth: folder of <view>.npz {depth}; flow: of {flow_px, valid}, and so
    model_flow; cameras: cameras.npz. The parts and the CSV appear together or not at
    all. Raises ValueError or OSError.
    """
    with ExitStack() as stack:
        # Entered first, so in place last: the CSV says that the folder is whole.
        stats_path = stack.enter_context(atomic.replace_file(stats_out))
        folder = stack.enter_context(atomic.replace_folder(out_flow))
        found_cameras = files.read_split(cameras, split, "pixtocams")

        def row_of(camera):
            view, (pixtocam,) = camera
            started = time.perf_counter()
            depth_path = Path(renders_depth) / f"{view}.npz"
            depth = archives.read(depth_path, ["depth"])["depth"]
            flows = [
                files.read_flow(Path(part) / f"{view}.npz")
                for part in (flow, model_flow)
                if part is not None
            ]
            try:
                fit, model_px = decompose(*flows, pixtocam=pixtocam, depth=depth)
                row = statistics(fit, model_px)
            except ValueError as error:
                raise ValueError(f"view {view}: {error}") from error
            write_parts(folder / f"{view}.npz", fit, model_px)
            time_s = round(time.perf_counter() - started, 4)
            has_flow = all(valid.any() for _, valid in flows)
            return has_flow, {"view": view, **row, "time_s": time_s}

        cameras_of = found_cameras.items()
        made = list(machine.map_in_threads(row_of, cameras_of, threads=threads))
        rows = [row for _, row in made]
        # What has no flow to begin with, `flow.align` has told.
        files.tell_unknown([row for has_flow, row in made if has_flow], *NO_DEPTH)
        files.write_rows(stats_path, COLUMNS, rows)
    return rows


def decompose(flow, model_flow=None, *, pixtocam, depth):
    """(camera_fit.Fit of the flow less the model's part, that part [h, w, 2] or None).

    flow, model_flow: (flow_px [h, w, 2], valid [h, w]) from the render, to the photo
    and to the oracle. With render(x) ~ oracle(x + m(x)), flow - m is the flow that
    the oracle has to the photo at x + m(x).
    """
    flow_px, valid = flow
    if model_flow is None:
        return camera_fit.split(flow_px, valid, pixtocam, depth), None
    model_px, model_valid = model_flow
    if model_px.shape != flow_px.shape:
        raise ValueError(f"model flow {model_px.shape} does not fit {flow_px.shape}")
    both = valid & model_valid
    return camera_fit.split(flow_px - model_px, both, pixtocam, depth), model_px


def statistics(fit: camera_fit.Fit, model_px=None):
    """A view's row, over its valid pixels.

    camera_fraction: how much of the squared length of the flow, less the model's part,
    the camera explains, lengths being capped; negative where the fit serves most
    pixels at the cost of that sum. moved_mean_px: what the pixels that do not move
    with the camera contribute to the mean length of the remainder. Where no pixel is
    valid all is empty.
    """
    if not fit.valid.any():
        return dict.fromkeys(COLUMNS[1:-1], "")
    net_px = fit.camera_px + fit.remainder_px
    model = {} if model_px is None else {"model": model_px}
    vectors_px = model | {
        "flow": net_px + model.get("model", 0),
        "camera": fit.camera_px,
        "remainder": fit.remainder_px,
    }
    vectors_px = {part: vectors[fit.valid] for part, vectors in vectors_px.items()}
    remainder_px = vectors_px["remainder"].astype(np.float64)
    remainder_px = np.linalg.norm(remainder_px, axis=-1)
    moved = fit.moved[fit.valid]
    net_length_px = np.linalg.norm(net_px[fit.valid], axis=-1)
    return {
        "valid_fraction": float(fit.valid.mean()),
        **{
            f"{part}_{name}": value
            for part in PARTS
            for name, value in files.lengths(vectors_px.get(part, ())).items()
        },
        "camera_fraction": explained(net_length_px, remainder_px),
        "moved_fraction": float(moved.mean()),
        "moved_mean_px": float((remainder_px * moved).mean()),
        "noise_px": fit.noise_px,
        **_camera(fit.motion),
        "fitted_pixels": fit.pixels,
    }


def explained(flow_length_px, remainder_length_px):
    """1 - sum |remainder|^2 / sum |flow|^2 of capped lengths [n]; of no flow, 0."""
    cap_px = np.percentile(flow_length_px, CAP_PERCENTILE)
    all_px2, rest_px2 = (
        np.square(np.minimum(length_px, cap_px)).sum()
        for length_px in (flow_length_px, remainder_length_px)
    )
    return float(1 - rest_px2 / all_px2) if all_px2 > 0 else 0.0


def _camera(motion):
    """The photo's camera in the frame of the render's, as columns."""
    turn_deg = np.degrees(motion.rotation)
    columns = {f"rotation_{x}_deg": float(turn_deg[i]) for i, x in enumerate("xyz")}
    columns |= {f"centre_{x}": float(motion.centre[i]) for i, x in enumerate("xyz")}
    return columns | {"focal_ratio": float(np.exp(motion.log_focal))}


def write_parts(path, fit: camera_fit.Fit, model_px):
    """Write camera_px, remainder_px (and model_px) [h, w, 2], valid, moved [h, w]."""
    parts = {} if model_px is None else {"model_px": model_px}
    for name in ("camera_px", "remainder_px", "valid", "moved"):
        parts[name] = getattr(fit, name)
    with atomic.replace_file(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, **parts)


OPTIONS = {
    "renders-depth": ("folder of <view>.npz", Path),
    "flow": ("folder of <view>.npz", Path),
    "cameras": ("cameras.npz", Path),
    "out-flow": ("folder of the parts, written", Path),
    "stats-out": ("CSV, written", Path),
    "split": ("of the views", {"choices": ("train", "test")}),
    "[threads]": ("views at once", 1),
    "[model-flow]": ("render to oracle", Path),
}


def run(arguments=None):
    """The command line; returns its exit code."""
    options = faults.arguments(arguments, __doc__, OPTIONS)
    return faults.exit_code(main, **vars(options))


if __name__ == "__main__":
    sys.exit(run())
