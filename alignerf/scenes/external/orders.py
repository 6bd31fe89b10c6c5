"""In which order another program counts photos, where its renders are numbered.

Programs sort photos by one name or another, or leave them as the cameras' file has
them, and may have left one out. Small pictures of renders and photos tell which.

Notation: photos {view: path}, as the cameras' file has them in turn; pairs {path of a
render: view}.
"""

import functools

import cv2
import numpy as np

from alignerf.metrics import pairs as of_pairs
from alignerf.scenes import photo_names
from alignerf.scenes import photos as of_photos

# What photos are sorted by, in words, and its key of a path. The first is that of
# gsplat and of 3D Gaussian splatting since 2024, the second of that before.
ORDERS = {
    "their names": lambda path: path.as_posix(),
    "their names without suffixes": lambda path: path.with_suffix("").as_posix(),
    "their names without folders": lambda path: path.name,
    "the numbers in their names": lambda path: photo_names.natural(path.as_posix()),
    "their names, small and capital letters alike": lambda path: (
        path.as_posix().casefold()
    ),
}
AS_GIVEN = "the cameras' file"
# Pairs that are looked at; and by how much more another order has to be like the photos
# than the usual one: correlations of small pictures.
SAMPLES, CLEARLY = 12, 0.02
# Sheets that are looked at for the half that is the photo.
FEW = 3
# Of so many photos one may have no render, or the other way round; so alike are small
# pictures then.
EVERY_ODD, ALIKE = 10, 0.5
# Of a JPEG: no more is decoded.
DECODED_PX = 128
# A sheet has twice a photo's width or height, of which an undone lens may take some.
TWICE = 0.15
# The part of a picture that is the render, and the other one: the photo.
HALVES = {
    "right": lambda image: image[:, image.shape[1] // 2 :],
    "left": lambda image: image[:, : image.shape[1] // 2],
    "bottom": lambda image: image[image.shape[0] // 2 :],
    "top": lambda image: image[: image.shape[0] // 2],
}
OTHER = {"right": "left", "left": "right", "bottom": "top", "top": "bottom"}


def of(photos):
    """{order in words: views}, each order once."""
    orders = {}
    for words, key in ORDERS.items():
        in_order = sorted(photos, key=lambda view: key(photos[view]))
        orders.setdefault(tuple(in_order), words)
    orders.setdefault(tuple(photos), AS_GIVEN)
    return {words: list(order) for order, words in orders.items()}


def part_of(render_size, photo_size):
    """The part of HALVES of a picture twice as wide or high as photos; None of one."""
    wider = (render_size[0] / render_size[1]) / (photo_size[0] / photo_size[1])
    parts = (("right", wider), ("bottom", 1 / wider))
    return next((part for part, times in parts if abs(times - 2) < TWICE), None)


def size_of(render):
    """(width, height) of a `layouts.Render`; ValueError of a sheet without halves."""
    width, height = of_photos.head(render.path).size
    sides = {"left": (2, 1), "right": (2, 1), "top": (1, 2), "bottom": (1, 2)}
    across, down = sides.get(render.part, (1, 1))
    if width % across or height % down:
        raise ValueError(
            f"{render.path}: {width}x{height} px: a photo and its render are of "
            "one size"
        )
    return width // across, height // down


def half(image, part):
    """The part of a picture that is the render; all of it where part is None."""
    return HALVES[part](image) if part else image


def which_half(of_views, photos):
    """{view: `layouts.Render`}, of sheets the half that is less like the photo.

    photos: {view: path}. The usual half, where neither has its details.
    """
    few, found = list(of_views.items())[:FEW], []
    if not (part := few[0][1].part):
        return of_views
    for view, one in few:
        photo, sheet = (
            of_photos.as_stored(p, "black") for p in (photos[view], one.path)
        )
        for place in (part, OTHER[part]):
            image = half(sheet, place)
            own = cv2.resize(photo, image.shape[1::-1], interpolation=cv2.INTER_AREA)
            found.append(of_pairs.likeness(*map(of_pairs.detail, (own, image))))
    own, other = np.reshape(found, (-1, 2)).mean(axis=0)
    if own > other + CLEARLY:
        of_views = {v: one._replace(part=OTHER[part]) for v, one in of_views.items()}
    return of_views


@functools.lru_cache(4096)
def thumb(path, part=None, upright=False):
    """A small picture of a file, as of `metrics.pairs`; None of one that is broken."""
    try:
        pixels = of_photos.decode(path, "black", upright=upright, least_px=DECODED_PX)[
            0
        ]
    except ValueError:
        return None
    return of_pairs.thumb(half(pixels, part))


def alike(photo, render, part):
    """Correlation of a photo's and a render's small pictures, by paths."""
    own = thumb(render, part)
    # A photo may lie on its side, and its render may not.
    turned = of_photos.head(photo).orientation in of_photos.SIDEWAYS
    seen = [thumb(photo, None, upright) for upright in {False, turned}]
    return max(
        float((one * own).sum()) if one is not None and own is not None else 0.0
        for one in seen
    )


def best(candidates, photos, part):
    """The place of the pairs that are most alike; 0 where none plainly are.

    Those pairs are looked at that are not the same in all.
    """
    there = set.intersection(*(set(pairs) for pairs in candidates))
    differ = sorted(p for p in there if len({pairs[p] for pairs in candidates}) > 1)
    looked_at = differ[:: max(-(-len(differ) // SAMPLES), 1)]
    if not looked_at:
        return 0
    found = [
        np.mean([alike(photos[pairs[p]], p, part) for p in looked_at])
        for pairs in candidates
    ]
    most = int(np.argmax(found))
    return most if found[most] > max(found[0] + CLEARLY, ALIKE) else 0


def aligned(views, renders, photos, part):
    """Pairs of renders and views in one order, of which the longer list has some more.

    None where these are many, or where pictures are not alike.
    """
    few, many = sorted((views, renders), key=len)
    more = len(many) - len(few)
    if not 0 < more <= max(len(many) // EVERY_ODD, 1) or len(few) <= more:
        return None
    paths = few is renders

    def likeness(one, other):
        render, view = (one, other) if paths else (other, one)
        return alike(photos[view], render, part)

    # Of each in the shorter list, by how many are left out before it.
    table = np.array(
        [
            [likeness(one, many[i + k]) for k in range(more + 1)]
            for i, one in enumerate(few)
        ]
    )
    total, back = table[0], []
    for row in table[1:]:
        before = np.maximum.accumulate(total)
        back.append(
            [
                int(np.flatnonzero(total[: k + 1] == before[k])[-1])
                for k in range(more + 1)
            ]
        )
        total = before + row
    left_out = [int(np.argmax(total))]
    for places in reversed(back):
        left_out.append(places[left_out[-1]])
    left_out.reverse()
    if np.median(table[np.arange(len(few)), left_out]) < ALIKE:
        return None
    chosen = [many[i + k] for i, k in enumerate(left_out)]
    return dict(
        zip(few, chosen, strict=True) if paths else zip(chosen, few, strict=True)
    )
