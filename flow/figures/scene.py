"""Figures of one scene: `python -m flow.figures.scene`.

flow.png: for one test view photo, the reference model's render, and the flow between
them. rounds.png: photo, the renders of each round above the flow that each round's
render still has to the photo. Both with the colour wheel and its scale in pixels.
Where asked, of the parts that `flow.decompose` found: views.png, every test view with
its flow and the parts; lengths.png, their histogram; curves.png, misalignment and PSNR
over the rounds.
"""

import argparse
import csv
import json
import sys
from pathlib import Path

import matplotlib.figure

from alignerf.command import faults
from flow.figures import drawing
from flow.figures import parts as part_figures
from flow.warping import files

PART_FIGURES = ("views", "lengths", "curves")


def main(photos, testset, reference, rounds, flow_figure, rounds_figure):
    """Write both figures. Raises ValueError or OSError."""
    view = middle_view(testset / "displacement.csv")
    photo = files.read_image(photos / f"{view}.png")
    render = files.read_image(reference / f"{view}.png")
    flow = files.read_flow(testset / "flow" / f"{view}.npz")
    draw_flow(view, photo, render, flow, flow_figure)
    steps = [
        (
            files.read_image(Path(entry["renders"]) / f"{view}.png"),
            files.read_flow(Path(entry["flow"]) / f"{view}.npz"),
        )
        for entry in json.loads(rounds)
    ]
    draw_rounds(view, photo, steps, rounds_figure)


def draw_parts(
    photos, rounds, parts, curves, views_figure, lengths_figure, curves_figure
):
    """Figures of the parts, of the first round's renders. Raises ValueError or OSError.

    curves: JSON list of {method, round, stats, metrics}.
    """
    found = part_figures.read_parts(parts)
    renders = Path(json.loads(rounds)[0]["renders"])
    part_figures.draw_views(found, photos, renders, views_figure)
    part_figures.draw_lengths(found, lengths_figure)
    table = part_figures.read_rounds(json.loads(curves))
    part_figures.draw_rounds(table, curves_figure)


def middle_view(path):
    """The view of middle misalignment: neither best nor worst case for the scene."""
    with open(path, newline="") as file:
        rows = sorted(csv.DictReader(file), key=lambda row: float(row["median_px"]))
    if not rows:
        raise ValueError(f"{path}: no view")
    return rows[len(rows) // 2]["view"]


def draw_flow(view, photo, render, flow, path):
    scale_px = drawing.flow_scale([flow])
    figure = matplotlib.figure.Figure(figsize=(13, 2.9), layout="constrained")
    axes = figure.subplots(1, 4, width_ratios=[1, 1, 1, 0.4])
    title = f"flow render to photo (median {drawing.median_px(flow):.2f} px)"
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
    scale_px = drawing.flow_scale([flow for _, flow in rounds])
    count = len(rounds)
    figure = matplotlib.figure.Figure(
        figsize=(3.4 * (count + 1), 5.4), layout="constrained"
    )
    axes = figure.subplots(2, count + 1)
    axes[0, 0].imshow(photo)
    axes[0, 0].set_title(f"photo {view}", fontsize=8)
    drawing.draw_wheel(axes[1, 0], scale_px)
    for number, (render, flow) in enumerate(rounds):
        column = axes[:, number + 1]
        column[0].imshow(render)
        column[0].set_title(f"render, round {number}", fontsize=8)
        column[1].imshow(drawing.coloured(flow, scale_px))
        title = f"its flow to the photo (median {drawing.median_px(flow):.2f} px)"
        column[1].set_title(title, fontsize=8)
    drawing.save_images(figure, path)


def run(arguments=None):
    """The command line; returns its exit code."""
    parser = argparse.ArgumentParser(prog="flow.figures.scene", description=__doc__)
    parser.add_argument("--photos", type=Path, required=True)
    parser.add_argument("--testset", type=Path, required=True, help="its folder")
    parser.add_argument("--reference", type=Path, required=True, help="its renders")
    parser.add_argument("--rounds", required=True, help="JSON: renders, flow folders")
    parser.add_argument("--flow-figure", type=Path, required=True, help="PNG")
    parser.add_argument("--rounds-figure", type=Path, required=True, help="PNG")
    of_parts = parser.add_argument_group("parts", "all of these or none")
    of_parts.add_argument("--parts", type=Path, help="of the first round")
    of_parts.add_argument("--curves", help="JSON: method, round, stats, metrics")
    for name in PART_FIGURES:
        of_parts.add_argument(f"--{name}-figure", type=Path, help="PNG")
    options = vars(parser.parse_args(arguments))
    names = ("parts", "curves", *(f"{name}_figure" for name in PART_FIGURES))
    chosen = {name: options.pop(name) for name in names}
    asked = [value is not None for value in chosen.values()]
    if any(asked) and not all(asked):
        parser.error("all options of the parts go together")

    def call():
        main(**options)
        if all(asked):
            draw_parts(options["photos"], options["rounds"], **chosen)

    return faults.exit_code(call)


if __name__ == "__main__":
    sys.exit(run())
