"""Figures of one scene: `python -m flow.figures`.

flow.png: for one test view photo, the reference model's render, and the flow between
them. rounds.png: photo, the renders of each round above the flow that each round's
render still has to the photo. Both with the colour wheel and its scale in pixels.
"""

import argparse
import csv
import json
import sys
from pathlib import Path

import matplotlib.figure
import numpy as np

from flow import colour_wheel, files

# One scale for all flows of a figure, this percentile of their lengths.
SCALE_PERCENTILE = 98
WHEEL_PX = 201


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


def middle_view(path):
    """The view of middle misalignment: neither best nor worst case for the scene."""
    with open(path, newline="") as file:
        rows = sorted(csv.DictReader(file), key=lambda row: float(row["median_px"]))
    if not rows:
        raise ValueError(f"{path}: no view")
    return rows[len(rows) // 2]["view"]


def flow_scale(flows):
    """Length in pixels at the wheel's rim, at least a tenth."""
    lengths = [np.linalg.norm(flow_px[valid], axis=-1) for flow_px, valid in flows]
    longest = np.percentile(np.concatenate(lengths), SCALE_PERCENTILE)
    return max(0.1, round(float(longest), 1))


def median_px(flow):
    flow_px, valid = flow
    return np.median(np.linalg.norm(flow_px[valid], axis=-1))


def draw_wheel(axes, scale_px):
    axes.imshow(colour_wheel.legend(WHEEL_PX))
    axes.set_title(f"flow, rim = {scale_px:.1f} px", fontsize=8)


def coloured(flow, scale_px):
    """Middlebury's code of a flow; black where it is not valid."""
    flow_px, valid = flow
    return colour_wheel.encode(flow_px, scale_px=scale_px, valid=valid)


def draw_flow(view, photo, render, flow, path):
    scale_px = flow_scale([flow])
    figure = matplotlib.figure.Figure(figsize=(13, 2.9), layout="constrained")
    axes = figure.subplots(1, 4, width_ratios=[1, 1, 1, 0.4])
    panels = {
        f"photo {view}": photo,
        "render of the reference model": render,
        f"flow render to photo (median {median_px(flow):.2f} px)": coloured(
            flow, scale_px
        ),
    }
    for axis, (title, image) in zip(axes, panels.items(), strict=False):
        axis.imshow(image)
        axis.set_title(title, fontsize=8)
    draw_wheel(axes[-1], scale_px)
    save(figure, path)


def draw_rounds(view, photo, rounds, path):
    scale_px = flow_scale([flow for _, flow in rounds])
    count = len(rounds)
    figure = matplotlib.figure.Figure(
        figsize=(3.4 * (count + 1), 5.4), layout="constrained"
    )
    axes = figure.subplots(2, count + 1)
    axes[0, 0].imshow(photo)
    axes[0, 0].set_title(f"photo {view}", fontsize=8)
    draw_wheel(axes[1, 0], scale_px)
    for number, (render, flow) in enumerate(rounds):
        column = axes[:, number + 1]
        column[0].imshow(render)
        column[0].set_title(f"render, round {number}", fontsize=8)
        column[1].imshow(coloured(flow, scale_px))
        title = f"its flow to the photo (median {median_px(flow):.2f} px)"
        column[1].set_title(title, fontsize=8)
    save(figure, path)


def save(figure, path):
    for axis in figure.axes:
        axis.set_axis_off()
    with files.replacing(path) as temporary:
        figure.savefig(temporary, dpi=150)


def run(arguments=None):
    """The command line; returns its exit code."""
    parser = argparse.ArgumentParser(prog="flow.figures", description=__doc__)
    parser.add_argument("--photos", type=Path, required=True)
    parser.add_argument("--testset", type=Path, required=True, help="its folder")
    parser.add_argument("--reference", type=Path, required=True, help="its renders")
    parser.add_argument("--rounds", required=True, help="JSON: renders, flow folders")
    parser.add_argument("--flow-figure", type=Path, required=True, help="PNG")
    parser.add_argument("--rounds-figure", type=Path, required=True, help="PNG")
    try:
        main(**vars(parser.parse_args(arguments)))
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(run())
