"""The layers of a view: its photo, renders, flows, and what each shows in words.

Notation: images [h, w, 3] uint8 RGB; flow_px [h, w, 2] from a render to its photo, in
pixels of the training size, `valid` [h, w] where it holds.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.files import archives, images
from alignerf.metrics import image as image_metrics
from alignerf.verdict import views as of_views
from flow.figures import colour_wheel

# The same for all scenes, so that one that is aligned looks so.
FULL_PX = 4.0
# Arrows of the flow across a picture, and how long one is at most.
ARROWS, LONGEST_PX = 16, 1e4
WHEEL_PX = 160


class Source(NamedTuple):
    """Where the layers of a split's views lie."""

    split: str
    # (folder of renders, folder of flow), round by round.
    rounds: list
    warped: Path | None
    truth: Path | None = None
    # {method: the same two folders} of methods beside the rounds.
    others: dict | None = None
    # The method of the rounds.
    method: str = ""


class Shown(NamedTuple):
    """A photo on the page.

    turns: quarter turns, clockwise, that make it stand upright. layers: {name: what
    reads it}. renders: {name: whose it is, in words}; flow: the archive of the first.
    """

    row: of_views.View
    turns: int
    layers: dict[str, Callable[[], np.ndarray]]
    renders: dict[str, str]
    flow: Path

    @property
    def key(self):
        """What the page calls it: two splits may share a name."""
        return f"{self.row.split}/{self.row.view}"


def of_view(row, source: Source, photos, limit_px, turns=0):
    """`Shown` of a photo; layers that its split lacks are left out."""
    name = row.view

    def image(folder):
        return lambda: np.rot90(images.read(Path(folder) / f"{name}.png"), -turns)

    def flow(folder):
        path = Path(folder) / f"{name}.npz"
        return lambda: coloured(*read_flow(path, turns), limit_px)

    layers, renders = {"photo": image(photos)}, {}
    for after, words, (render, shift) in of_rounds(source):
        layers[f"render{after}"] = image(render)
        layers[f"flow{after}"] = flow(shift)
        renders[f"render{after}"] = words
    if source.warped is not None:
        layers["warped photo"] = image(source.warped)
    if source.truth is not None:
        layers["truth"] = image(source.truth)
    first = Path(source.rounds[0][1]) / f"{name}.npz"
    return Shown(row, turns, layers, renders, first)


def of_rounds(source: Source):
    """(what follows a layer's name, whose it is, its two folders): the first, the last.

    And after these, methods beside the rounds.
    """
    last = len(source.rounds) - 1
    repaired = bool(last > 0 or source.others)
    words = f"by {source.method}" + ", before any repair" * repaired
    found = [("", words, source.rounds[0])]
    if last > 0:
        words = f"by {source.method} after round {last}"
        found.append((f" after round {last}", words, source.rounds[last]))
    for name, folders in (source.others or {}).items():
        found.append((f", {name}", f"by {name}, which aligns on the way", folders))
    return found


def read_flow(path, turns=0):
    """(flow_px [h, w, 2], valid [h, w]), upright."""
    data = archives.read(path, ("flow_px", "valid"))
    return turned(data["flow_px"], turns), np.rot90(data["valid"], -turns)


def turned(flow_px, turns):
    """A flow [h, w, 2] after quarter turns of its image: right becomes down."""
    for _ in range(turns):
        flow_px = np.rot90(flow_px, -1)
        flow_px = np.stack([-flow_px[..., 1], flow_px[..., 0]], axis=-1)
    return flow_px


def coloured(flow_px, valid, limit_px):
    """A flow's colours [h, w, 3] at the fixed scale, fading under the limit."""
    faded = colour_wheel.faded(flow_px, limit_px)
    return colour_wheel.encode(faded, scale_px=FULL_PX, valid=valid)


def wheel(limit_px):
    """The wheel [WHEEL_PX, WHEEL_PX, 3] that says what the colours mean."""
    return colour_wheel.legend(WHEEL_PX, scale_px=FULL_PX, least_px=limit_px)


def arrows(shown: Shown):
    """Arrows of the first flow: {size: [w, h], step, tips: [[dx, dy] or None]}.

    Medians in tenths of a pixel over squares of `step` px, row by row from the top;
    None where less than half of a square is valid.
    """
    flow_px, valid = read_flow(shown.flow, shown.turns)
    h, w = valid.shape
    step = max(-(-w // ARROWS), 1)
    tips = []
    for top in range(0, h, step):
        for left in range(0, w, step):
            part = slice(top, top + step), slice(left, left + step)
            holds = valid[part] & np.isfinite(flow_px[part]).all(axis=-1)
            if 2 * holds.sum() < holds.size:
                tips.append(None)
            else:
                tip = np.median(flow_px[part][holds], axis=0)
                tip = np.clip(tip, -LONGEST_PX, LONGEST_PX)
                tips.append(np.round(10 * tip).astype(int).tolist())
    return {"size": [w, h], "step": step, "tips": tips}


def captions(shown: Shown, photo_px):
    """{layer: what it shows, in words}, with the shift and the fine detail.

    photo_px: pixels of the photo in one of the training's.
    """
    row = shown.row
    how = "held out of the training" if row.split == "test" else "trained on"
    said = {"photo": f"photo as taken, {how}", "warped photo": "photo, warped onto it"}
    said["truth"] = "what the photo would show without any misalignment"
    detail = image_metrics.detail(shown.layers["photo"]())
    for place, (name, whose) in enumerate(shown.renders.items()):
        share = image_metrics.detail(shown.layers[name]()) / max(detail, 1e-6)
        parts = [f"render {whose}", f"{100 * share:.0f} % of the photo's fine detail"]
        if not place and np.isfinite(row.flow_px):
            parts.insert(1, f"{photo_px * row.flow_px:.1f} px from the photo")
        said[name] = ", ".join(parts)
        said["flow" + name.removeprefix("render")] = (
            f"flow from the {name} to the photo"
        )
    return {name: said[name] for name in shown.layers}
