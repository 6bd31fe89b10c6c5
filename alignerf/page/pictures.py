"""The images of the page: which views, which layers, and how they come to fit.

Notation: images [h, w, 3] uint8 RGB; flow_px [h, w, 2] from a render to its photo, in
pixels of the training size, `valid` [h, w] where it holds. A *layer* is one image of a
view: its photo, a render, the warped photo, a flow in colours.
"""

import base64
import io
import itertools
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from alignerf.files import archives, images
from alignerf.verdict import limit
from flow.figures import colour_wheel

# The same for all scenes, so that one that is aligned looks so.
FULL_PX = 4.0
MOST_TEST, MOST_TRAIN = 10, 4
# The page stays under 15 MB, of which base64 takes a quarter and tables the rest.
MOST_BYTES = 10_000_000
# (longest side in px, WebP's quality): the first under MOST_BYTES is taken.
SIZES = ((1280, 88), (960, 85), (720, 82), (540, 78), (400, 70), (280, 60))
WHEEL_PX = 160


class Source(NamedTuple):
    """Where the layers of a view's split lie."""

    split: str
    # (folder of renders, folder of flow), round by round.
    rounds: list
    warped: Path | None
    truth: Path | None = None
    # {method: the same two folders} of methods beside the rounds.
    others: dict | None = None


class Shown(NamedTuple):
    """A view of the page."""

    view: str
    split: str
    # Words below the images: how far apart, how alike, why it stands out.
    note: str
    layers: dict[str, np.ndarray]


def choose(views):
    """Those shown, the farthest from their renders first.

    views: `verdict.views.View`s. Of the test views all or, of many, those that stand
    out and evenly spaced others; of the training views those that stand out.
    """
    test = [view for view in views if view.split == "test"]
    train = [view for view in views if view.split == "train" and view.stands_out]
    if not test:
        # Of another program, whose held-out views are not there.
        test, train = list(views), []
    if len(test) > MOST_TEST:
        odd = sorted((view for view in test if view.stands_out), key=_length)
        odd = odd[-MOST_TEST // 2 :]
        rest = [view for view in test if view not in odd]
        places = np.linspace(0, len(rest) - 1, MOST_TEST - len(odd))
        test = [*odd, *(rest[i] for i in places.round().astype(int))]
    train = sorted(train, key=_length)[-MOST_TRAIN:]
    return sorted([*test, *train], key=_length, reverse=True)


def _length(view):
    return view.flow_px if np.isfinite(view.flow_px) else np.inf


def layers_of(view, source: Source, photos, limit_px, turns=0):
    """{name: image} of a view; layers that its split lacks are left out.

    turns: quarter turns, clockwise, that make it stand upright.
    """

    def read(folder):
        return np.rot90(images.read(Path(folder) / f"{view}.png"), -turns)

    layers = {"photo": read(photos)}
    last = len(source.rounds) - 1
    pairs = {"": source.rounds[0]}
    if last > 0:
        pairs[f" after round {last}"] = source.rounds[last]
    others = (source.others or {}).items()
    pairs |= {f", {name}": folders for name, folders in others}
    for after, (renders, flow) in pairs.items():
        layers[f"render{after}"] = read(renders)
        data = archives.read(Path(flow) / f"{view}.npz", ("flow_px", "valid"))
        flow_px, valid = turned(data["flow_px"], turns), np.rot90(data["valid"], -turns)
        layers[f"flow{after}"] = coloured(flow_px, limit_px, valid)
    if source.warped is not None:
        layers["warped photo"] = read(source.warped)
    if source.truth is not None:
        layers["truth"] = read(source.truth)
    return layers


def turned(flow_px, turns):
    """A flow [h, w, 2] after quarter turns of its image: right becomes down."""
    for _ in range(turns):
        flow_px = np.rot90(flow_px, -1)
        flow_px = np.stack([-flow_px[..., 1], flow_px[..., 0]], axis=-1)
    return flow_px


def coloured(flow_px, limit_px, valid=None):
    """A flow's colours [h, w, 3] at the fixed scale, fading under the limit."""
    faded = colour_wheel.faded(flow_px, limit_px)
    return colour_wheel.encode(faded, scale_px=FULL_PX, valid=valid)


def wheel(limit_px):
    """The wheel [WHEEL_PX, WHEEL_PX, 3] that says what the colours mean."""
    return colour_wheel.legend(WHEEL_PX, scale_px=FULL_PX, least_px=limit_px)


def limit_of(evidence):
    """Length in px under which a flow is too short to tell, of a verdict's evidence."""
    return limit.limit_px(evidence.get("overfit_px"))


def fitted(shown):
    """{view: {layer: data URI}}, at the first of SIZES that fits into the page.

    Views are left out from the end where even the smallest is too large.
    """
    for longest_px, quality in SIZES:
        uris = _encoded(shown, longest_px, quality)
        if uris is not None:
            return uris
    return _encoded(shown, *SIZES[-1], cut=True)


def _encoded(shown, longest_px, quality, *, cut=False):
    """{view: {layer: data URI}}; beyond MOST_BYTES None or, if cut, those so far."""
    views, size = {}, 0
    for one in shown:
        uris = {
            name: data_uri(image, longest_px, quality)
            for name, image in one.layers.items()
        }
        size += sum(map(len, uris.values())) * 3 // 4
        if size > MOST_BYTES:
            return views if cut else None
        views[one.split + "/" + one.view] = uris
    return views


def data_uri(image, longest_px=None, quality=None):
    """An image as a data URI; lossless where no quality is given."""
    picture = Image.fromarray(np.ascontiguousarray(image))
    if longest_px is not None:
        # Never larger than it is.
        picture.thumbnail((longest_px, longest_px), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    options = {"lossless": True} if quality is None else {"quality": quality}
    picture.save(buffer, "WEBP", method=4, **options)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()


def layer_names(shown):
    """Names of all layers, in the order in which views have them."""
    names = itertools.chain.from_iterable(one.layers for one in shown)
    return list(dict.fromkeys(names))
