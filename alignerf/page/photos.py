"""Every photo of a scene on the page: its numbers, its images, its place in a strip."""

import numpy as np

from alignerf.files import csv_files, json_files, machine
from alignerf.page import contents, layers, pictures
from alignerf.verdict import views

# Of the strip, in units of its drawing.
STRIP_HEIGHT = 100
# A length is `low` up to its limit, `high` beyond so many limits.
HIGH = 3.0


def shown(folder, rounds, others, base, limit_px):
    """`layers.Shown` of each photo that has a render, the worst first.

    rounds, others, base: as of `page.render`. limit_px: under which colours fade.
    """
    turns = contents.quarter_turns(folder)
    sources = sources_of(folder, rounds, others, base)
    return [
        layers.of_view(
            row, sources[row.split], folder / "images", limit_px, turns.get(row.view, 0)
        )
        for row in pictures.in_order(scored(folder, sources))
    ]


def scored(folder, splits):
    """`views.View`s of views.csv. ValueError for a split that was not rendered."""
    path = folder / "tables" / "views.csv"
    table = csv_files.read(path, columns=views.COLUMNS)
    for row in table.itertuples():
        if not isinstance(row.view, str):
            raise ValueError(f"{path}: a view without a name")
        if row.split not in splits:
            fault = f"view {row.view!r:.60}: no renders of split {row.split!r:.60}"
            raise ValueError(f"{path}: {fault}")
    # Empty where a view does not, which is read as a number where none does.
    reasons = [why if isinstance(why, str) else "" for why in table["stands_out"]]
    table["stands_out"] = np.array(reasons, object)
    return [views.View(**row) for row in table[list(views.COLUMNS)].to_dict("records")]


def sources_of(folder, rounds, others, base):
    """{split: `layers.Source`} of the splits whose views were rendered."""
    method, truth = base.parent.name, folder / "images" / "truth" / "oracle"
    found = {}
    if rounds:
        found["test"] = layers.Source(
            "test",
            rounds,
            base / "warped" / "test",
            truth if truth.is_dir() else None,
            others,
            method,
        )
    if (base / "renders" / "train").is_dir():
        first = [(base / "renders" / "train", base / "flow" / "train")]
        found["train"] = layers.Source(
            "train", first, base / "warped" / "train", method=method
        )
    return found


def scale(folder):
    """Pixels of the photo in one of the training's."""
    path = folder / "poses.json"
    poses = json_files.read(path, contents.POSES)
    for key in ("width", "photo_width"):
        if not poses[key] > 0:
            raise ValueError(f"{path}: {key} is {poses[key]!r:.60}")
    return poses["photo_width"] / poses["width"]


def entries(every, limit_px, photo_px):
    """A mapping of each photo for the page and its scripts; lengths in px of the photo.

    every: `layers.Shown`s. limit_px: in px of the training.
    """

    def entry(one):
        return {
            "key": one.key,
            "name": one.row.view,
            "split": one.row.split,
            "px": length(photo_px * one.row.flow_px),
            "level": level(one.row.flow_px, limit_px),
            "why": one.row.stands_out,
            "captions": layers.captions(one, photo_px),
            "arrows": layers.arrows(one),
        }

    return list(machine.map_in_threads(entry, every))


def length(px):
    """Two digits behind the point; None where it is not known."""
    return round(float(px), 2) if np.isfinite(px) else None


def level(px, limit_px):
    """`low`, `middle` or `high`; `unknown` without a number."""
    if not np.isfinite(px):
        return "unknown"
    return "low" if px <= limit_px else "middle" if px <= HIGH * limit_px else "high"


def strip(photos, limit_px):
    """Bars of all photos by name: {bars, limit, most_px}, heights of STRIP_HEIGHT.

    photos: `entries`. limit_px: in px of the photo.
    """
    known = [one["px"] for one in photos if one["px"] is not None]
    most_px = max([*known, 2 * limit_px])
    by_name = sorted(photos, key=lambda one: one["name"])
    bars = [
        {"photo": one, "height": STRIP_HEIGHT * max(one["px"] or 0, 0) / most_px}
        for one in by_name
    ]
    return {"bars": bars, "limit": STRIP_HEIGHT * limit_px / most_px, "most": most_px}


def afters(every, tried):
    """Layers of renders after a repair, the one that gained most first.

    every: `layers.Shown`s. tried: the verdict's; without them, the last is first.
    """
    names = dict.fromkeys(name for one in every for name in list(one.renders)[1:])
    gained = {f"render, {t.get('method')}": t.get("db") or 0.0 for t in tried}
    order = list(reversed(names))
    return sorted(order, key=lambda name: -gained.get(name, -np.inf))


def opening(every, after):
    """{key, left, right} of what the page opens with: before and after.

    The worst photo that has both; without any, the worst beside its render.
    """
    for one in every:
        if after and after[0] in one.layers:
            return {"key": one.key, "left": "render", "right": after[0]}
    return {"key": every[0].key, "left": "photo", "right": "render"}
