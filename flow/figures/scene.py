"""Figures of one scene: `python -m flow.figures.scene`.

flow.png: for one test view photo, the reference model's render, and the flow between
them. rounds.png: photo, the renders of each round above the flow that each round's
render still has to the photo. Both with the colour wheel and its scale in pixels.
lengths.png: a histogram of the flow and of the parts that `flow.decompose` found.
curves.png: misalignment and PSNR over the rounds. Where there are staged methods,
crops.png: see `crops`.
"""

import json
import sys
from pathlib import Path

import matplotlib.figure

from alignerf.io import csv_files, faults, images
from flow.figures import crops as crop_figure
from flow.figures import drawing
from flow.figures import parts as part_figures
from flow.warping import files

FIGURES = ("flow", "rounds", "lengths", "curves")


def main(photos, testset, reference, rounds, parts, curves, out, crops=None):
    """Write all figures into the folder `out`. Raises ValueError or OSError.

    photos, reference: folders of images; testset: its folder; rounds: JSON list of
    {renders, flow, method}, of the reference's rounds the method is null; parts: folder
    of those of the first round's renders; curves: the scene's scores.csv; crops: JSON
    list of {method, renders, flow}.
    """
    figures = {name: out / f"{name}.png" for name in FIGURES}
    rounds = rows_of(rounds, "--rounds")
    draw_middle_view(photos, testset, reference, rounds, figures)
    part_figures.draw_lengths(part_figures.read_parts(parts), figures["lengths"])
    table = part_figures.read_rounds(curves)
    part_figures.draw_rounds(table, figures["curves"])
    if crops is not None:
        crop_figure.draw_methods(photos, rows_of(crops, "--crops"), out / "crops.png")


def rows_of(text, option):
    """The mappings of a JSON list, each with folders of `renders` and of their `flow`.

    Raises ValueError naming the option for what is none.
    """
    try:
        rows = json.loads(text)
        right = [isinstance(row[k], str) for row in rows for k in ("renders", "flow")]
    except (ValueError, TypeError, LookupError, RecursionError):
        right = []
    if not right or not all(right):
        raise ValueError(f"{option}: not a JSON list of renders and their flow")
    return rows


def draw_middle_view(photos, testset, reference, rounds, figures):
    """The figures of one view: its flow, and its rounds."""
    view = middle_view(testset / "displacement.csv")
    photo = images.read(photos / f"{view}.png")
    render = images.read(reference / f"{view}.png")
    flow = files.read_flow(testset / "flow" / f"{view}.npz")
    draw_flow(view, photo, render, flow, figures["flow"])
    steps = [
        (
            entry.get("method") or f"round {number}",
            images.read(Path(entry["renders"]) / f"{view}.png"),
            files.read_flow(Path(entry["flow"]) / f"{view}.npz"),
        )
        for number, entry in enumerate(rounds)
    ]
    draw_rounds(view, photo, steps, figures["rounds"])


def middle_view(path):
    """The view of middle misalignment: neither best nor worst case for the scene."""
    table = csv_files.read(path, columns=("view", "median_px"))
    # Python's sort, stable: of views that are equally far, the order by name.
    known = table.dropna(subset="median_px")
    rows = sorted(known.itertuples(), key=lambda row: row.median_px)
    return rows[len(rows) // 2].view


def draw_flow(view, photo, render, flow, path):
    scale_px = drawing.flow_scale([flow])
    figure = matplotlib.figure.Figure(figsize=(13, 2.9), layout="constrained")
    axes = figure.subplots(1, 4, width_ratios=[1, 1, 1, 0.4])
    title = f"flow render to photo (median {drawing.median(flow)})"
    panels = {
        f"photo {view}": photo,
        "render of the reference model": render,
        title: drawing.coloured(flow, scale_px),
    }
    for axis, (title, image) in zip(axes, panels.items(), strict=False):
        axis.imshow(image)
        axis.set_title(title, fontsize=8)
    drawing.draw_wheel(axes[-1], scale_px)
    drawing.save_images(figure, path)


def draw_rounds(view, photo, rounds, path):
    """rounds: (its name, render, flow to the photo) of each."""
    scale_px = drawing.flow_scale([flow for _, _, flow in rounds])
    count = len(rounds)
    figure = matplotlib.figure.Figure(
        figsize=(3.4 * (count + 1), 5.4), layout="constrained"
    )
    axes = figure.subplots(2, count + 1)
    axes[0, 0].imshow(photo)
    axes[0, 0].set_title(f"photo {view}", fontsize=8)
    drawing.draw_wheel(axes[1, 0], scale_px)
    for number, (name, render, flow) in enumerate(rounds):
        column = axes[:, number + 1]
        column[0].imshow(render)
        column[0].set_title(f"render, {name}", fontsize=8)
        column[1].imshow(drawing.coloured(flow, scale_px))
        title = f"its flow to the photo (median {drawing.median(flow)})"
        column[1].set_title(title, fontsize=8)
    drawing.save_images(figure, path)


OPTIONS = {
    "photos": ("folder of images", Path),
    "testset": ("its folder", Path),
    "reference": ("its renders", Path),
    "rounds": "JSON: renders, flow folders",
    "parts": ("of the first round", Path),
    "curves": "the scene's scores.csv",
    "[crops]": "JSON: method, renders, flow",
    "out": ("folder of the PNGs", Path),
}


def run(arguments=None):
    """The command line; returns its exit code."""
    options = faults.arguments(arguments, __doc__, OPTIONS)
    return faults.exit_code(main, **vars(options))


if __name__ == "__main__":
    sys.exit(run())
