"""How the images of the page come to fit into it.

Notation: images [h, w, 3] uint8 RGB.
"""

import base64
import io

import numpy as np
from PIL import Image

from alignerf.causes.shared import misalignment
from alignerf.io import machine

# The page stays under 15 MB. Base64 adds a third to these.
MAX_BYTES = 6_000_000
# (longest side in px, WebP's quality): the first under MAX_BYTES is taken.
SIZES = ((1280, 88), (960, 85), (720, 82), (540, 78), (400, 70), (280, 60))
# With less space only so many photos have every layer; others have photo and renders,
# and what is named of them.
MAX_WHOLE, KEPT = 12, ("photo", "what comes and goes")
THUMBS, MAX_THUMB_BYTES = ((144, 60), (96, 55), (64, 45), (32, 40)), 750_000
# Of a page's photos so many tell how large all will be.
SAMPLE = 5


def in_order(views):
    """The photos, the farthest from their renders first.

    views: `verdict.views.View`s. Those without a length come first.
    """

    def length(view):
        return view.flow_px if np.isfinite(view.flow_px) else np.inf

    return sorted(views, key=length, reverse=True)


def limit_of(evidence):
    """Length in px under which a flow is too short to tell, of a verdict's evidence."""
    return misalignment.told_px(evidence.get("overfit_px"))


def fitted(shown):
    """{view: {layer: data URI}} of `photos.Shown`, as large as the page has space.

    Where even the smallest images are too many, photos at the end have none.
    """
    for longest_px, quality in SIZES:
        for whole in dict.fromkeys((len(shown), min(MAX_WHOLE, len(shown)))):
            wanted = list(zip(shown, chosen(shown, whole), strict=True))
            if guessed_bytes(wanted, longest_px, quality) > 1.2 * MAX_BYTES:
                continue
            uris = encoded(wanted, longest_px, quality)
            if len(uris) == len(shown):
                return uris
    return encoded(wanted, *SIZES[-1])


def chosen(shown, whole):
    """Names of the layers of each photo: all of the first `whole`."""
    return [
        [name for name in one.layers if i < whole or name in (*KEPT, *one.renders)]
        for i, one in enumerate(shown)
    ]


def guessed_bytes(wanted, longest_px, quality):
    """Bytes of all images, by a few of them."""
    step = max(len(wanted) // SAMPLE, 1)
    few = wanted[::step]
    size = sum(sum(map(size_of, uris_of(*one, longest_px, quality))) for one in few)
    count = sum(len(names) for _, names in few)
    return size / max(count, 1) * sum(len(names) for _, names in wanted)


def size_of(uri):
    """Bytes behind a data URI."""
    return len(uri) * 3 // 4


def uris_of(one, names, longest_px, quality):
    """A data URI of each of a photo's layers."""
    return [data_uri(one.layers[name](), longest_px, quality) for name in names]


def encoded(wanted, longest_px, quality):
    """{view: {layer: data URI}} of the first photos that fit."""
    found, size = {}, 0
    made = machine.map_in_threads(
        lambda pair: uris_of(*pair, longest_px, quality), wanted
    )
    for (one, names), uris in zip(wanted, made, strict=False):
        size += sum(map(size_of, uris))
        if size > MAX_BYTES:
            break
        found[one.key] = dict(zip(names, uris, strict=True))
    return found


def thumbs(shown):
    """{view: data URI} of small pictures of all photos."""

    def small(one):
        return smaller(Image.fromarray(one.layers["photo"]()), THUMBS[0][0])

    pictures = list(machine.map_in_threads(small, shown))
    for longest_px, quality in THUMBS:
        uris = [encode(smaller(one, longest_px), quality) for one in pictures]
        if sum(map(size_of, uris)) <= MAX_THUMB_BYTES:
            break
    return {one.key: uri for one, uri in zip(shown, uris, strict=True)}


def data_uri(image, longest_px=None, quality=None):
    """An image as a data URI; lossless where no quality is given."""
    picture = Image.fromarray(np.ascontiguousarray(image))
    return encode(smaller(picture, longest_px), quality)


def smaller(picture, longest_px):
    """A picture with sides of at most so many px, never larger than it is."""
    if longest_px is not None:
        picture.thumbnail((longest_px, longest_px), Image.Resampling.LANCZOS)
    return picture


def encode(picture, quality=None):
    """A picture as a data URI; lossless where no quality is given."""
    buffer = io.BytesIO()
    options = {"lossless": True} if quality is None else {"quality": quality}
    picture.save(buffer, "WEBP", method=2, **options)
    return "data:image/webp;base64," + base64.b64encode(buffer.getvalue()).decode()
