"""Are pairs that are none named, and renders not? See `alignerf.metrics.pairs`.

--results: folder of results; of each scene its photos at training size, spoilt, and the
renders of all its trainings, as they are.
"""

import itertools

import cv2
import numpy as np

from alignerf.io import images
from alignerf.metrics import pairs
from tools.bench import measure


def run(options):
    """A row of each kind of renders: how many pairs, and how many are named as what."""
    captures = {
        place.parent.name: read(place)
        for place in sorted(options.results.glob("*/images"))
    }
    rows = [
        row(what, [(photos, make(photos)) for photos in captures.values()])
        for what, make in SPOILT.items()
    ]
    others = [
        (own, dict(zip(own, blurred(resized(other, own)), strict=True)))
        for own, other in itertools.permutations(captures.values(), 2)
    ]
    trained = [
        (captures[folder.parents[3].name], read(folder))
        for folder in sorted(options.results.glob("*/*/round*/renders/*"))
    ]
    return [row("trained", trained), *rows, row("of another capture", others)]


def read(folder):
    return {path.stem: images.read(path) for path in sorted(folder.glob("*.png"))}


def blurred(photos, sigma_px=1.5):
    return [cv2.GaussianBlur(photo, (0, 0), sigma_px) for photo in photos]


def resized(others, own):
    """Photos of another capture at the size of this one, each as often as it takes."""
    size = next(iter(own.values())).shape[1::-1]
    chosen = itertools.islice(itertools.cycle(others.values()), len(own))
    return [cv2.resize(one, size) for one in chosen]


def every(make):
    """Renders {view: image} that a function makes of each photo, blurred before."""
    return lambda photos: dict(
        zip(photos, map(make, blurred(photos.values())), strict=True)
    )


def half(image):
    image = image.copy()
    image[: len(image) // 2] = 0
    return image


def packed(image):
    """A copy as JPEG of quality 95."""
    code = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])[1]
    return cv2.imdecode(code, cv2.IMREAD_COLOR)


def shifted(photos):
    names = list(photos)
    later = blurred(photos[name] for name in names[1:] + names[:1])
    return dict(zip(names, later, strict=True))


SPOILT = {
    "photos, blurred by 1.5 px": every(lambda image: image),
    "photos, blurred by 6 px": every(lambda image: blurred([image], 5.8)[0]),
    "copies of the photos": lambda photos: {n: packed(p) for n, p in photos.items()},
    "mirrored": every(lambda image: np.ascontiguousarray(image[:, ::-1])),
    "upside down": every(lambda image: np.ascontiguousarray(image[::-1, ::-1])),
    "of the next photo": shifted,
    "half black": every(half),
    "of one colour": every(lambda image: np.full_like(image, 90)),
    "40 times darker": every(lambda image: (image / 40).astype(np.uint8)),
}


def row(what, sets):
    """The share of pairs that are named, and as what."""
    faults, count = [], 0
    for photos, renders in sets:
        everywhere = np.ones(next(iter(photos.values())).shape[:2], bool)
        seen = {
            view: pairs.look(photos[view], render, everywhere, whole=True)
            for view, render in renders.items()
        }
        found = pairs.check(seen, list(seen))
        count += found.count
        faults += [kind for kind, _ in found.faults.values()]
    named = {kind: faults.count(kind) for kind in pairs.KINDS if kind in faults}
    note = ", ".join(f"{kind} {n}" for kind, n in named.items()) or "nothing"
    share = measure.one(len(faults) / max(count, 1))
    return measure.Row(what, "share", share, note=f"of {count} pairs: {note}")
