"""Every photo of a scene on the page: numbers, layers, crops at its own size.

Notation: images [h, w, 3] uint8 RGB; flow_px [h, w, 2] from a render to its photo, in
pixels of the training size, `valid` [h, w] where it holds.
"""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from alignerf.cameras import transients
from alignerf.io import archives, csv_files, faults, images, machine
from alignerf.page import contents, pictures
from alignerf.scenes import prepared
from alignerf.verdict import views as of_views
from flow.figures import drawing

# The same for all scenes, so that one that is aligned looks so.
FULL_PX = 4.0
# Arrows of the flow across a picture, and how long one is at most.
ARROWS, LONGEST_PX = 16, 1e4
WHEEL_PX = 160
# Of the strip, in units of its drawing.
STRIP_HEIGHT = 100
# A length is `low` up to its limit, `high` beyond so many limits.
HIGH = 3.0
# The photo with a line around what comes and goes, of its longer side and in RGB.
TRANSIENT, LINE, LINE_COLOUR = pictures.KEPT[1], 0.006, (255, 0, 160)
# Times that the page enlarges the part that it opens with.
SCALE = 2.5
# Thumbnails that are not folded away.
SOME = 24
# Of crops at the photos' own size, in folders of trainings on them.
CROPS_QUALITY = 90
CROPS_BYTES = 1_500_000


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


def of_view(row, sources, folder, base, limit_px, turns=0, mask=None):
    """`Shown` of a photo; sources: of its split, as `sources_of` finds them.

    mask: where it shows what others do not, or None.
    """
    name = row.view

    def image(folder):
        return lambda: np.rot90(images.read(Path(folder) / f"{name}.png"), -turns)

    def flow(folder):
        path = Path(folder) / f"{name}.npz"
        return lambda: coloured(*read_flow(path, turns), limit_px)

    layers = {"photo": image(folder / "images")}
    if mask is not None:
        layers[TRANSIENT] = lambda: outlined(layers["photo"](), np.rot90(mask, -turns))
    for after, (_, render, shift) in sources.items():
        layers[f"render{after}"] = image(render)
        layers[f"flow{after}"] = flow(shift)
    layers["warped photo"] = image(base / "warped" / row.split)
    truth = folder / "images" / "truth" / "oracle"
    if row.split == "test" and truth.is_dir():
        layers["truth"] = image(truth)
    renders = {f"render{after}": words for after, (words, *_) in sources.items()}
    return Shown(row, turns, layers, renders, Path(sources[""][2]) / f"{name}.npz")


def outlined(photo, mask):
    """The photo [h, w, 3] with a line around a mask, as of `transients.of_photo`."""
    where = transients.of_photo(mask, photo.shape[1::-1]).astype(np.uint8)
    width_px = max(round(max(photo.shape) * LINE), 1)
    lines, _ = cv2.findContours(where, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    return cv2.drawContours(photo.copy(), lines, -1, LINE_COLOUR, width_px)


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
    faded = drawing.faded(flow_px, limit_px)
    return drawing.encode(faded, scale_px=FULL_PX, valid=valid)


def wheel(limit_px):
    """The wheel [WHEEL_PX, WHEEL_PX, 3] that says what the colours mean."""
    return drawing.legend(WHEEL_PX, scale_px=FULL_PX, min_px=limit_px)


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
    """{layer: what it shows, in words}, with the misalignment.

    photo_px: pixels of the photo in one of the training's.
    """
    row = shown.row
    how = "held out" if row.split == "test" else "a training photo"
    said = {"photo": f"photo, {how}", "warped photo": "photo, warped onto the render"}
    said[TRANSIENT] = "photo; others of the same place do not show what is outlined"
    said["truth"] = "ground truth, what the photo would show without misalignment"
    for place, (name, whose) in enumerate(shown.renders.items()):
        said[name] = f"render {whose}"
        if not place and np.isfinite(row.flow_px):
            said[name] += f", {photo_px * row.flow_px:.1f} px from the photo"
        said["flow" + name.removeprefix("render")] = (
            f"flow from the {name} to the photo"
        )
    return {name: said[name] for name in shown.layers}


def shown(folder, rounds, others, base, limit_px, whose):
    """`Shown` of each photo that has a render, the worst first.

    rounds, others, base: as of `page.render`. limit_px: under which colours fade.
    whose: what the reference is called.
    """
    turns = contents.quarter_turns(folder)
    sources = sources_of(rounds, others, base, f"by {whose}")
    path = folder / "transients.npz"
    masks = transients.read(path) if path.is_file() else {}

    def of(row):
        own = turns.get(row.view, 0), masks.get(row.view)
        return of_view(row, sources[row.split], folder, base, limit_px, *own)

    return [*map(of, pictures.in_order(scored(folder, sources)))]


def scored(folder, splits):
    """`of_views.View`s of views.csv. ValueError for a split that was not rendered."""
    path = folder / "tables" / "views.csv"
    table = csv_files.read(path, columns=of_views.COLUMNS)
    for row in table.itertuples():
        if not isinstance(row.view, str):
            raise ValueError(f"{path}: a view without a name")
        if row.split not in splits:
            lacking = f"no renders of split {faults.shown(row.split)}"
            raise ValueError(f"{path}: view {faults.shown(row.view)}: {lacking}")
    # Empty where a view does not, which is read as a number where none does.
    reasons = [why if isinstance(why, str) else "" for why in table["stands_out"]]
    table["stands_out"] = np.array(reasons, object)
    return [
        of_views.View(**row) for row in table[list(of_views.COLUMNS)].to_dict("records")
    ]


def sources_of(rounds, others, base, by):
    """{split: {what follows a layer's name: (whose, in words, renders, flow)}}.

    Of the splits that were rendered: the first round, the last, and methods beside the
    rounds. by: whose the rounds are.
    """
    found = {}
    if rounds:
        last = f" after round {len(rounds) - 1}"
        several = len(rounds) > 1
        found["test"] = {
            "": (by + ", before any fix" * bool(several or others), *rounds[0])
        }
        if several:
            found["test"][last] = (by + last, *rounds[-1])
        for name, folders in (others or {}).items():
            found["test"][f", {name}"] = (f"by {name}", *folders)
    if (base / "renders" / "train").is_dir():
        found["train"] = {"": (by, base / "renders" / "train", base / "flow" / "train")}
    return found


def scale(folder):
    """Pixels of the photo in one of the training's."""
    poses = prepared.read_poses(folder)
    return poses["photo_width"] / poses["width"]


def entries(every, limit_px, photo_px):
    """A mapping of each photo for the page and its scripts; lengths in px of the photo.

    every: `Shown`s. limit_px: in px of the training.
    """

    def entry(one):
        return {
            "key": one.key,
            "name": one.row.view,
            "split": one.row.split,
            "px": length(photo_px * one.row.flow_px),
            "level": level(one.row.flow_px, limit_px),
            "why": one.row.stands_out,
            "captions": captions(one, photo_px),
            "arrows": arrows(one),
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
    """Bars of all photos by name: {bars, limit, max_px}, heights of STRIP_HEIGHT.

    photos: `entries`. limit_px: in px of the photo.
    """
    known = [one["px"] for one in photos if one["px"] is not None]
    max_px = max([*known, 2 * limit_px])
    by_name = sorted(photos, key=lambda one: one["name"])
    bars = [
        {"photo": one, "height": STRIP_HEIGHT * max(one["px"] or 0, 0) / max_px}
        for one in by_name
    ]
    return {"bars": bars, "limit": STRIP_HEIGHT * limit_px / max_px, "most": max_px}


def afters(every, tried, reference="", *, of_one_model=True):
    """Layers of renders after a fix, the headline's first, then what gained most.

    every: `Shown`s. tried: the verdict's; without them, the last is first. reference:
    the method of the rounds. of_one_model: else the headline's may be of another than
    what is shown before it.
    """
    names = dict.fromkeys(name for one in every for name in list(one.renders)[1:])
    rounds = [name for name in names if not name.startswith("render,")]
    gained = {}
    for one in tried:
        # Of several rounds the last is shown.
        own = rounds if one["method"] == reference else [f"render, {one['method']}"]
        gained |= dict.fromkeys(own, (of_one_model and one["in_headline"], one["db"]))
    worst = False, -np.inf
    return sorted(names, key=lambda name: gained.get(name, worst))[::-1]


def opening(every, after):
    """{key, left, right, x, y, scale} of what the page opens with: before and after.

    The photo in which a part gains most sharpness, and that part; without any that has
    both, the worst one's part that its render blurs most.
    """

    def part(one, soft, sharp):
        gained = spread(one.layers[sharp]()) - spread(one.layers[soft]())
        h, w = (round(side / SCALE) for side in gained.shape)
        means = cv2.blur(gained, (w, h), borderType=cv2.BORDER_REFLECT)
        means = means[h // 2 : h // 2 - h or None, w // 2 : w // 2 - w or None]
        top, left = np.unravel_index(means.argmax(), means.shape)
        place = {"x": left / gained.shape[1], "y": top / gained.shape[0]}
        return float(means.max()), {key: round(at, 3) for key, at in place.items()}

    both = [one for one in every if after and after[0] in one.layers]
    left, right = ("render", after[0]) if both else ("photo", "render")
    soft_sharp = ("render", after[0]) if both else ("render", "photo")
    found = [(part(one, *soft_sharp), one.key) for one in both or every[:1]]
    (_, place), key = max(found, key=lambda one: one[0][0])
    return {"key": key, "left": left, "right": right, "scale": SCALE} | place


def spread(image):
    """How much detail an image has around each pixel [h, w], in grey levels."""
    grey = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    return np.abs(cv2.Laplacian(grey.astype(np.float32), cv2.CV_32F))


def crops(given, corrected, by, shown):
    """{view: [{layers: {name: data URI}, offset_px}]} of the photos' crops.

    given, corrected: folders results/SCENE/METHOD/round0 of trainings with the cameras
    as given and as the method `by` has put them right; None where there is none.
    offset_px: where a crop's render by the second lies from the first, x first; left
    out without it. Photos at the end of `shown` have none where they do not fit.
    """
    if not given:
        return {}
    before, after = (
        crops_of_folder(given),
        crops_of_folder(corrected) if corrected else {},
    )
    found, size = {}, 0
    for one in shown:
        for name in crops_of(one, before):
            entry = crop(before[name], after.get(name), by, one.turns)
            size += sum(map(pictures.size_of, entry["layers"].values()))
            if size > CROPS_BYTES:
                return found
            found.setdefault(one.key, []).append(entry)
    return found


def crops_of(one, before):
    """Names of a photo's crops, in order."""
    return sorted(name for name in before if name.rpartition("_w")[0] == one.row.view)


def crops_of_folder(base):
    """{crop: (its photo, its render, its corner in px)} of a training."""
    base = Path(base)
    scene = prepared.load(base.parents[1])
    middles = np.linalg.inv(scene.pixtocams)[:, :2, 2]
    found = {}
    for view, name in enumerate(scene.names):
        render = base / "renders" / str(scene.split[view]) / f"{name}.png"
        photo = scene.folder / "images" / f"{name}.png"
        if render.is_file():
            # A corner further to the right has the principal point further left.
            found[name] = photo, render, -middles[view]
    return found


def crop(before, after, by, turns):
    """A crop's images as data URIs, and the offset of the last."""

    def uri(path):
        return pictures.data_uri(
            np.rot90(images.read(path), -turns), None, CROPS_QUALITY
        )

    layers = {"photo": uri(before[0]), "render": uri(before[1])}
    entry = {"layers": layers}
    if after is not None:
        layers[f"render, {by}"] = uri(after[1])
        moved = np.round(after[2] - before[2]).astype(int)
        for _ in range(turns):
            moved = np.array([-moved[1], moved[0]])
        entry["offset_px"] = moved.tolist()
    return entry
