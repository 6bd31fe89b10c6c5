"""Figures of what the misalignment is made of: lengths, and rounds.

Notation: `parts` {view: {part: flow_px [h, w, 2]}} with valid [h, w] among them; all
lengths in pixels.
"""

import logging

import matplotlib.figure
import numpy as np
import pandas as pd

from alignerf.io import archives, csv_files, faults
from flow.figures import drawing

log = logging.getLogger("alignerf")

# In this order; the model's part only where the truth is known.
TITLES = {
    "flow_px": "flow to photo",
    "model_px": "model's part",
    "camera_px": "camera part",
    "remainder_px": "remainder",
}
COLOURS = {
    "flow_px": "black",
    "model_px": "tab:gray",
    "camera_px": "tab:blue",
    "remainder_px": "tab:orange",
}
TEST_SETS = {"standard": "-", "oracle": "--"}
WIDTH_INCH = 7.2
BINS = 80
# Of the flow's lengths, what the histogram shows.
SHOWN_PERCENTILE = 99


def read_parts(folder):
    """{view: {part: array}} of a folder that `flow.decompose` wrote, by name."""
    paths = sorted(folder.glob("*.npz"))
    if not paths:
        raise ValueError(f"{folder}: no parts (*.npz)")
    return {path.stem: read_view(path) for path in paths}


def read_view(path):
    """The parts of a view, their sum as flow_px, and valid."""
    keys = ("camera_px", "remainder_px", "valid")
    model = archives.read(path, ["model_px"]) if archives.has(path, "model_px") else {}
    camera_px, remainder_px, valid = archives.read(path, keys).values()
    flow_px = camera_px + remainder_px + model.get("model_px", 0)
    parts = {"flow_px": flow_px, **model, "camera_px": camera_px}
    return parts | {"remainder_px": remainder_px, "valid": valid}


def present(parts):
    """The parts that every view has, in order."""
    return [name for name in TITLES if all(name in view for view in parts.values())]


def draw_lengths(parts, path):
    """Share of the test views' valid pixels by length, for the flow and its parts."""
    lengths_px = {
        name: np.concatenate(
            [
                np.linalg.norm(view[name][view["valid"]], axis=-1)
                for view in parts.values()
            ]
        )
        for name in present(parts)
    }
    if not len(lengths_px["flow_px"]):
        raise ValueError(f"no valid flow in any of {faults.some_names([*parts])}")
    longest_px = np.percentile(lengths_px["flow_px"], SHOWN_PERCENTILE)
    edges = np.linspace(0, max(float(longest_px), 0.1), BINS + 1)
    figure = matplotlib.figure.Figure(figsize=(5, 3), layout="constrained")
    axes = figure.subplots()
    for name, length_px in lengths_px.items():
        # Of all pixels, so that what lies beyond the last edge is missing, not hidden.
        density = np.histogram(length_px, edges)[0] / len(length_px) / edges[1]
        label = f"{TITLES[name]} (median {np.median(length_px):.2f} px)"
        axes.stairs(density, edges, color=COLOURS[name], label=label)
    axes.set_xlabel("length (px)")
    axes.set_ylabel("share of valid pixels per px")
    axes.set_xlim(0, edges[-1])
    axes.set_ylim(bottom=0)
    axes.legend(fontsize=drawing.FONT_SIZE, title=f"{len(parts)} test views")
    drawing.save(figure, path)


def read_rounds(path):
    """Means per method and round that was trained; path: of a scene's scores.csv.

    A view without a number leaves the mean empty rather than better, and the log says
    which.
    """
    columns = ("method", "round", "test_set", "view", "metric", "value")
    table = csv_files.read(path, columns=columns)
    lines = []
    for (method, round), own in table.groupby(["method", "round"], sort=False):
        flow = own[own["metric"] == "flow_median_px"]
        if flow.empty:
            continue
        psnr = own[own["metric"] == "psnr_db"]
        say_empty(path, f"flow_median_px of {method}, round {round}", flow)
        say_empty(path, f"psnr_db of {method}, round {round}", psnr)
        psnr_db = psnr.groupby("test_set")["value"].mean(skipna=False)
        median_px = flow["value"].mean(skipna=False)
        labels = {"method": method, "round": round}
        lines.append({**labels, "median_px": median_px, **psnr_db})
    if not lines:
        raise ValueError(f"{path}: no flow_median_px of any method")
    return pd.DataFrame(lines)


def say_empty(path, what, table):
    """Log the views that have no number."""
    empty = table[table["value"].isna()]
    if len(empty):
        views = faults.some_names(sorted(set(empty["view"])))
        log.warning("%s: no %s in %s: its mean is left empty", path, what, views)


def draw_rounds(table, path):
    """Median misalignment, and PSNR, over the rounds; a colour per method."""
    figure = matplotlib.figure.Figure(figsize=(WIDTH_INCH, 2.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    sets = [name for name in TEST_SETS if name in table]
    for method, rounds in table.groupby("method", sort=False):
        (line,) = left.plot(
            rounds["round"], rounds["median_px"], "o-", markersize=4, label=method
        )
        for name in sets:
            style = {"color": line.get_color(), "linestyle": TEST_SETS[name]}
            right.plot(rounds["round"], rounds[name], marker="o", markersize=4, **style)
    for name in sets:
        right.plot([], [], color="gray", linestyle=TEST_SETS[name], label=name)
    left.set_ylabel("median flow to photo (px)")
    highest_px = table["median_px"].max()
    left.set_ylim(0, 1.1 * highest_px if highest_px > 0 else 1)
    right.set_ylabel("PSNR (dB)")
    for axes in (left, right):
        axes.set_xlabel("warping rounds")
        axes.set_xticks(sorted(table["round"].unique()))
        axes.margins(x=0.1)
        axes.grid(alpha=0.3)
    # Misalignment hardly nears 0 where there is any: below it there is room.
    left.legend(fontsize=drawing.FONT_SIZE - 1, loc="lower left")
    right.legend(fontsize=drawing.FONT_SIZE - 1)
    figure.suptitle("means over test views", fontsize=drawing.FONT_SIZE)
    drawing.save(figure, path)
