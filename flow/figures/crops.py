"""Crops side by side, as in the paper's teaser: `figures/crops.png`.

A row for each of a few test views: the photo with a crop marked; the crop of the
photo and of each method's render, with its PSNR in dB; then of each render's flow to
the photo, with its median length in px, all flows on one colour scale.

Neither views nor crops are chosen by what a method does: VIEWS views, evenly
spaced among the test views by name, and of each the square crop of a quarter of
the photo's width that holds most of the photo's high frequencies.
"""

import textwrap
from pathlib import Path
from typing import NamedTuple

import cv2
import matplotlib.figure
import matplotlib.patches
import numpy as np
import skimage.metrics

from alignerf.io import images
from flow.figures import drawing
from flow.warping import files

VIEWS = 3
# Of the photo's width; less where the photo is not as high.
CROP_FRACTION = 0.25
# High frequencies are what this blur takes away: details of a few pixels.
BLUR_SIGMA_PX = 2.0
# A page's width for two methods.
CELL_INCH = 1.12
# The legend's width.
MIN_INCH = 5.5
# Wider or narrower photos are shown smaller: so many cells wide.
PHOTO_WIDTHS = (0.5, 3.0)
# Letters that a cell is wide.
CELL_LETTERS = 16
# Large crops keep their pixels, up to this.
MAX_DPI = 600
NOTE = (
    "color: direction and length of the flow from render to photo,\n"
    "one scale for all; black: not valid. px: median length in the crop.\n"
    "dB: PSNR of the crop. Crop: a quarter of the photo's width,\n"
    "where the photo has most high frequencies; it depends on no method."
)


class Crop(NamedTuple):
    """A square of a photo, in pixels."""

    left: int
    top: int
    side: int

    def cut(self, image):
        """The crop's part [side, side, ...] of an image [h, w, ...]."""
        rows = slice(self.top, self.top + self.side)
        return image[rows, self.left : self.left + self.side]


def choose_crop(photo):
    """The crop of a photo [h, w, 3] uint8 with most high-frequency energy.

    The energy is the squared difference of grey values to those blurred; of equal
    crops it is the uppermost, of these the leftmost.
    """
    height, width = photo.shape[:2]
    side = min(max(1, round(CROP_FRACTION * width)), height)
    grey = cv2.cvtColor(photo, cv2.COLOR_RGB2GRAY).astype(np.float64)
    blurred = cv2.GaussianBlur(grey, (0, 0), BLUR_SIGMA_PX)
    # Whole numbers, so that equal crops have equal sums.
    energy = np.round(1000 * (grey - blurred) ** 2)
    total = cv2.integral(energy)
    sums = total[side:, side:] - total[:-side, side:]
    sums += total[:-side, :-side] - total[side:, :-side]
    top, left = np.unravel_index(np.argmax(sums), sums.shape)
    return Crop(int(left), int(top), side)


def choose_views(names):
    """VIEWS of the names, evenly spaced, the first and the last among them."""
    count = min(VIEWS, len(names))
    return [names[i] for i in np.linspace(0, len(names) - 1, count).round().astype(int)]


def psnr_db(image, photo):
    """Peak signal-to-noise ratio of 8-bit images; infinite where they are equal."""
    with np.errstate(divide="ignore"):
        return skimage.metrics.peak_signal_noise_ratio(photo, image)


class Row(NamedTuple):
    """A test view: its photo, the crop, and of each method what it shows there."""

    view: str
    photo: np.ndarray  # [h, w, 3]
    crop: Crop
    renders: list  # [side, side, 3]
    flows: list  # (flow_px [side, side, 2], valid [side, side])


def read_row(view, photos, methods):
    """Raises ValueError, naming the file, for a render or flow of another size."""
    photo = images.read(photos / f"{view}.png")
    crop = choose_crop(photo)
    renders, flows = [], []
    for method in methods:
        path = Path(method["renders"]) / f"{view}.png"
        render = images.read(path)
        flow_path = Path(method["flow"]) / f"{view}.npz"
        flow_px, valid = files.read_flow(flow_path)
        for image, name in ((render, path), (flow_px, flow_path)):
            if image.shape[:2] != photo.shape[:2]:
                raise ValueError(f"{name}: not of the size of photo {view}")
        renders.append(crop.cut(render))
        flows.append((crop.cut(flow_px), crop.cut(valid)))
    return Row(view, photo, crop, renders, flows)


def draw_methods(photos, methods, path):
    """Draw the figure. Raises ValueError or OSError.

    photos: a folder. methods: [{method, renders, flow}], two folders of test views.
    """
    folder = Path(methods[0]["renders"])
    names = sorted(path.stem for path in folder.glob("*.png"))
    if not names:
        raise ValueError(f"{folder}: no renders (*.png)")
    rows = [read_row(view, photos, methods) for view in choose_views(names)]
    draw(rows, [method["method"] for method in methods], path)


def draw(rows, methods, path):
    """A row of cells a view, the legend below."""
    scale_px = drawing.flow_scale([flow for row in rows for flow in row.flows])
    height, width = rows[0].photo.shape[:2]
    cells = 1 + 2 * len(methods)
    widths = [np.clip(width / height, *PHOTO_WIDTHS), *[1] * cells]
    flows = [f"flow of {method}" for method in methods]
    headings = list(map(in_lines, ["photo", "its crop", *methods, *flows]))
    lines = 1 + max(heading.count("\n") for heading in headings)
    inches = (CELL_INCH + 0.25) * len(rows) + 0.15 * lines + 0.1, 1.1
    figure = matplotlib.figure.Figure(
        figsize=(max(CELL_INCH * sum(widths), MIN_INCH), sum(inches)),
        layout="constrained",
    )
    top, bottom = figure.subfigures(2, height_ratios=inches)
    grid = top.subplots(len(rows), 1 + cells, squeeze=False, width_ratios=widths)
    for axes, row in zip(grid, rows, strict=True):
        draw_row(axes, row, scale_px)
    for axes, heading in zip(grid[0], headings, strict=True):
        axes.set_title(heading, fontsize=drawing.FONT_SIZE, parse_math=False)
    drawing.draw_legend(bottom, scale_px, NOTE)
    dpi = max(row.crop.side for row in rows) / CELL_INCH
    drawing.save_images(figure, path, dpi=np.clip(dpi, drawing.DPI, MAX_DPI))


def draw_row(axes, row, scale_px):
    """The cells of a view: photo, its crop, the renders' crops, their flows."""
    axes[0].imshow(row.photo)
    write_below(axes[0], in_lines(row.view))
    left, top, side = row.crop
    # Around the crop's outermost pixels, whose centres are whole numbers.
    square = matplotlib.patches.Rectangle(
        (left - 0.5, top - 0.5), side, side, fill=False, color="red", clip_on=False
    )
    axes[0].add_patch(square)
    photo = row.crop.cut(row.photo)
    axes[1].imshow(photo)
    of_renders, of_flows = np.split(axes[2:], 2)
    for cell, render in zip(of_renders, row.renders, strict=True):
        cell.imshow(render)
        write_below(cell, f"{psnr_db(render, photo):.1f} dB")
    for cell, flow in zip(of_flows, row.flows, strict=True):
        cell.imshow(drawing.coloured(flow, scale_px))
        write_below(cell, drawing.median(flow))


def in_lines(text):
    return "\n".join(textwrap.wrap(text, CELL_LETTERS))


def write_below(axes, text):
    where = {"ha": "center", "va": "top", "transform": axes.transAxes}
    # A dollar in a photo's name is no formula.
    style = {"fontsize": drawing.FONT_SIZE, "parse_math": False}
    axes.text(0.5, -0.03, text, **where, **style)
