"""The moving arm: `arm.csv`.

The paper's last experiment: an object with a part in one of two states. Of scenes with
right poses, methods that leave them so (NeRF); of scenes with perturbed ones, methods
that learn them (BARF). Does learning them blur what stands still? Beside it lies
a picture: the two states, their difference, renders, and their errors.
"""

import matplotlib.figure
import numpy as np
import pandas as pd

from alignerf.io import images
from alignerf.tables import columns, frame, latex

# Against ground truth: where nothing moves, and where the arm may be.
PLACES = {"still": "oracle_still", "moving": "oracle_moving"}
CELL_INCH, LABEL_PT = 2.0, 8


def make_table(views):
    """A line a row of a `frame.read_scenes`, right poses first.

    Differences are to the first row.
    """
    order = views.sort_values("perturb_px", kind="stable")
    (_, first), *_ = order.groupby(["scene", "method"], sort=False)
    views = frame.beside(order, first, "first_db", ["test_set", "view"])
    lines = {}
    for place, test_set in PLACES.items():
        against = {f"{place}_": None, f"{place}_difference_": "first_db"}
        own = frame.summary(views, ["scene", "method"], [test_set], against=against)
        for line in own:
            key = line["scene"], line["method"]
            lines[key] = line | lines.get(key, {})
    table = pd.DataFrame(lines.values(), columns=columns.names("arm"))
    return table.astype({"params": "Int64"})


def to_latex(table):
    return latex.of_table("arm", table)


def beside(views, table, args):
    """The picture."""
    names = sorted(views["view"].unique())
    return {".png": lambda path: draw(table, names, args.results, path)}


def draw(table, names, results, path):
    """The two states and their difference; below, each row's render and its error.

    The view is the test view whose photo differs most from the undisplaced scene, where
    poses are right: its photo shows the arm's other state.
    """
    every = list(zip(table["scene"], table["method"], strict=True))
    right = results / every[0][0]
    pairs = [
        tuple(
            images.read(right / where / f"{n}.png")
            for where in ("images/truth/oracle", "images")
        )
        for n in names
    ]
    apart = [np.abs(a.astype(float) - b).mean() for a, b in pairs]
    name, (one, other) = names[np.argmax(apart)], pairs[np.argmax(apart)]
    top = {"one state": one, "the other": other, "difference": difference(one, other)}
    figure = matplotlib.figure.Figure(
        figsize=(CELL_INCH * max(len(every), 3), 3 * CELL_INCH), layout="constrained"
    )
    axes = figure.subplots(3, max(len(every), 3), squeeze=False)
    for cell in axes.flat:
        cell.axis("off")
    for cell, (title, image) in zip(axes[0], top.items(), strict=False):
        show(cell, title, image)
    for column, (scene, method) in zip(axes[1:].T, every, strict=False):
        render = images.read(
            results / scene / method / f"round0/renders/test/{name}.png"
        )
        truth = images.read(results / scene / f"images/truth/oracle/{name}.png")
        show(column[0], f"{method}, {scene}", render)
        show(column[1], "error", difference(render, truth))
    figure.savefig(path, dpi=200)


def show(cell, title, image):
    cell.imshow(image)
    cell.set_title(title, fontsize=LABEL_PT, parse_math=False)


def difference(one, other):
    """The absolute difference of two images, three times as bright."""
    apart = np.abs(one.astype(float) - other.astype(float))
    return np.clip(3 * apart, 0, 255).astype(np.uint8)
