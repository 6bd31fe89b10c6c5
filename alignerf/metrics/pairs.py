"""Checks whether each render of another program is one of its photo.

It may be a copy of the photo, flat, empty, swapped with another view's, turned or
mirrored, of another place, or far too bright. That is checked before any cause is
looked for, and the verdict's sentences and advice for it stand here. Thresholds come
from trained renders of four captures and from damaged ones: docs/evidence/verdict.md.

Notation: photo and render [h, w, 3] uint8 of one size; counts [h, w]: the pixels that
count in both.
"""

import itertools
from typing import NamedTuple

import cv2
import numpy as np

# If a larger share of pairs fails, no verdict is given; else the failing ones are left
# out.
MAX_BAD = 0.1
# A copy: correlation of the finest detail, at least (copies, also as JPEG of quality
# 75, have 0.85 and more, renders at most 0.83), or at least so much of renders as
# detailed as their photos (copies of which a lens was undone have 0.7 and more); 8-bit
# levels by which colours differ, at most (copies 0.4, renders 0.8 and more); the blur
# before that in px.
COPY, SHARP_COPY, COPY_LEVELS, COPY_BLUR_PX = 0.8, 0.65, 0.6, 8.0
# Levels of 8 bits: a render's tile is empty below, a photo's shows something above. The
# share of such tiles is 0 of renders.
EMPTY, SHOWS, MAX_EMPTY, TILES = 1.0, 6.0, 0.4, 16
# Where a photo's background is blank, a render of its level, exposed otherwise, lacks a
# part of the object: a model may. Above the last share it shows none of it.
BACKGROUND, NOTHING = 64.0, 0.9
# A render shows another photo, or is turned, where it correlates better with that, and
# what is missing to 1 is at most half as much.
THUMB_PX, LESS = 32, 0.5
# Where that photo's own render shows it, too, what is missing has to be so much less.
# A turned one is at least so alike.
PLAINLY, TURNED = 0.1, 0.8
# Correlation of small pictures: a render of another place stays below the first. Where
# for the median render a tenth of all photos are nearer than its own, apart from what
# all have in common, renders are of another place; unless all photos are as alike as
# the last.
ALIKE, FAR, SAME, FEW = 0.5, 0.1, 0.99, 5
# What a wrong lens or wrong cameras do to all renders alike: of small pictures.
ZOOMS, SHIFTS_PX = (0.8, 0.9, 1.0, 1.1, 1.25), (-3, -2, -1, 0, 1, 2, 3)
# Of light; a photo of 8 bits has no less than DARKEST.
MAX_STOPS, DARKEST = 2.0, 0.001

# What a render is instead, in words; {what} is what a view's fault adds.
KINDS = {
    "copy": "copies of their photos",
    "flat": "of one color",
    "empty": "empty where their photos show something",
    "swapped": "of other photos than those of the same name",
    "turned": "turned or mirrored",
    "strange": "of none of these photos",
    "bright": f"over {MAX_STOPS:g} stops brighter or darker than their photos",
}
ADVICE = {
    "copy": "give the program's renders: RENDERS holds photos.",
    "flat": "look at the renders: the training may have failed.",
    "empty": "render whole photos; give alpha 0 where a render must be empty.",
    "swapped": "give each render the name of its photo, and judge again.",
    "turned": "rotate photos and renders alike: EXIF or cameras may say how. No "
    "program can use a mirrored photo.",
    "strange": "give photos and renders of one capture.",
    "bright": "give renders as PNG or JPEG in sRGB, as the photos are.",
}


class Seen(NamedTuple):
    """What a pair looks like.

    photo, render: small pictures, as `thumb` makes them. fault: of KINDS, by this pair
    alone; None. faint: so much is missing that the rest does not say whose it is.
    """

    photo: np.ndarray
    render: np.ndarray
    fault: str | None
    faint: bool


class Checked(NamedTuple):
    """Of all pairs: how many, and {view: (kind, what)} of those that fail."""

    count: int
    faults: dict

    def only(self, kind):
        """The same with faults of one kind alone."""
        faults = {view: one for view, one in self.faults.items() if one[0] == kind}
        return self._replace(faults=faults)

    @property
    def stops(self):
        """Whether so many fail that nothing else is told."""
        return len(self.faults) > MAX_BAD * self.count


def look(photo, render, counts, *, whole, own=False) -> Seen:
    """A pair; whole: emptiness is looked for outside of `counts`, too.

    So it is of renders without alpha: what is black in these up to their border does
    not count, and may be half of the picture. own: the render was made here, of a
    splat, and is no copy however good it is.
    """
    render_there = np.where(counts[..., None], render, photo)
    shown = np.ones_like(counts) if whole else counts
    missing, cut = shares_empty(photo, render, shown)
    is_empty, faint = cut > MAX_EMPTY or missing > NOTHING, missing > MAX_EMPTY
    fault = fault_of(photo, render, counts, is_empty, faint)
    no_fault = own and fault == "copy"
    return Seen(thumb(photo), thumb(render_there), None if no_fault else fault, faint)


def fault_of(photo, render, counts, is_empty, faint):
    """The first fault that a pair has by itself."""
    if (render[counts] == render[counts][:1]).all():
        return "flat"
    levels = [max(light(image[counts]), DARKEST) for image in (photo, render)]
    # An object that is missing leaves a black background, and much less light.
    if abs(np.log2(levels[0] / levels[1])) > MAX_STOPS and (is_empty or not faint):
        return "bright"
    if is_empty:
        return "empty"
    own, other = detail(photo)[counts], detail(render)[counts]
    is_sharp = norm(other) > norm(own)
    if likeness(own, other) < (SHARP_COPY if is_sharp else COPY):
        return None
    return "copy" if apart_levels(photo, render, counts) < COPY_LEVELS else None


def apart_levels(photo, render, counts):
    """How far smooth colours are apart in levels, each channel made as bright."""
    there = np.where(counts[..., None], render, photo)
    own, other = (
        cv2.GaussianBlur(one.astype(np.float32), (0, 0), COPY_BLUR_PX)[counts]
        for one in (photo, there)
    )
    gain = (own * other).sum(axis=0) / np.maximum((other**2).sum(axis=0), 1)
    return float(np.abs(own - gain * other).mean())


def shares_empty(photo, render, counts):
    """Of the tiles in which the photo shows something: where the render shows nothing.

    And where it shows nothing that the photo does: a blank background is something.
    """
    (levels, own), (others, other) = map(tiles, (photo, render))
    counted, is_blank = places(counts) > 0, np.median(own) < EMPTY
    shows, empty = counted & (own > SHOWS), other < EMPTY
    is_background = is_blank & (np.abs(others - np.median(levels)) < BACKGROUND)
    due = counted if is_blank else shows
    return share(empty, shows), share(empty & ~is_background, due)


def share(mask, of):
    """Share of the pixels of another mask [h, w] that are in a mask; 0 of none."""
    return (mask & of).sum() / max(of.sum(), 1)


def tiles(image):
    """Mean and standard deviation in each tile of a picture's luminance."""
    values = grey(image)
    side = tile_px(values)
    mean, square = (cv2.blur(v, (side, side)) for v in (values, values**2))
    return places(mean), places(np.sqrt(np.maximum(square - mean**2, 0)))


def places(values):
    """Values [h, w] at the middles of tiles."""
    side = tile_px(values)
    return values[side // 2 :: side, side // 2 :: side]


def tile_px(values):
    return max(max(values.shape) // TILES, 1)


def grey(image):
    return cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY).astype(
        np.float32
    )


def detail(image):
    """What a blur by a pixel takes from a picture's luminance [h, w]."""
    values = grey(image)
    return values - cv2.GaussianBlur(values, (0, 0), 1.0)


def light(values):
    """Mean of sRGB values [n, 3] as light, from 0 to 1."""
    values = values / 255.0
    curve = ((values + 0.055) / 1.055) ** 2.4
    return float(np.where(values < 0.04045, values / 12.92, curve).mean())


def likeness(first, second):
    """Correlation of two arrays; 0 where one is constant."""
    first, second = (one - one.mean() for one in (first, second))
    return float((first * second).sum() / max(norm(first) * norm(second), 1e-6))


def norm(values):
    return float(np.sqrt(np.square(values, dtype=np.float64).sum()))


def thumb(image):
    """A small picture [THUMB_PX, THUMB_PX] of length 1; its mean taken off."""
    size = (THUMB_PX, THUMB_PX)
    return normal(cv2.resize(grey(image), size, interpolation=cv2.INTER_AREA))


def check(seen, main) -> Checked:
    """What fails among pairs {view: Seen}.

    main: views that renders of other places are told by: a held-out view may be bad
    where photos are few.
    """
    if not seen:
        return Checked(0, {})
    faults = {view: (one.fault, "") for view, one in seen.items() if one.fault}
    names = list(seen)
    photos = np.array([one.photo.ravel() for one in seen.values()])
    renders = np.array([one.render.ravel() for one in seen.values()])
    # Cameras or a lens may be wrong for all alike: then a photo is still nearest to its
    # render once that is undone.
    undone = without_common(list(seen.values()))
    for view, other in swapped(names, photos, renders, undone).items():
        faults.setdefault(view, ("swapped", f"shows {other}"))
    for view, one in seen.items():
        if how := turned(one):
            faults.setdefault(view, ("turned", how))
    main = [view for view in main if not seen[view].faint]
    for view in strange(names, photos, renders, undone, main):
        faults.setdefault(view, ("strange", ""))
    return Checked(len(seen), {view: faults[view] for view in seen if view in faults})


def without_common(seen):
    """Renders [n, pixels] moved and zoomed, all alike, to be most like their photos."""
    best, found, middle = -np.inf, None, (THUMB_PX - 1) / 2
    photos = np.array([one.photo.ravel() for one in seen])
    for zoom, x, y in itertools.product(ZOOMS, SHIFTS_PX, SHIFTS_PX):
        at = [[zoom, 0, (1 - zoom) * middle + x], [0, zoom, (1 - zoom) * middle + y]]
        moved = [moved_by(np.array(at), one.render).ravel() for one in seen]
        if (alike := (np.array(moved) * photos).sum()) > best:
            best, found = alike, np.array(moved)
    return found


def moved_by(matrix, picture):
    border = cv2.BORDER_REPLICATE
    size = (THUMB_PX, THUMB_PX)
    return normal(cv2.warpAffine(picture, matrix, size, borderMode=border))


def normal(picture):
    """A picture of length 1, its mean taken off."""
    values = picture - picture.mean()
    return values / max(norm(values), 1e-6)


def swapped(names, photos, renders, undone):
    """{view: another whose photo its render shows}; see LESS.

    photos, renders [n, pixels]; undone: as of `without_common`.
    """
    if len(names) < 2:
        return {}
    alike = renders @ photos.T
    own, best = (
        np.maximum(np.diag(alike), (undone * photos).sum(1)),
        alike.argmax(axis=1),
    )
    most = alike[np.arange(len(names)), best]
    found = (best != np.arange(len(names))) & (1 - most < LESS * (1 - own))
    found &= most > ALIKE
    # One render may fit either of two nearly equal photos: then it is swapped only if
    # the other photo's render is swapped too, or if it fits the other plainly better.
    plainly = 1 - most < PLAINLY * (1 - own)
    found &= found[best] | plainly
    return {names[i]: names[best[i]] for i in np.flatnonzero(found)}


def turned(one: Seen):
    """How a render is turned or mirrored against its photo, in words; None."""
    own, best, how = (one.photo * one.render).sum(), TURNED, None
    for words, other in turnings(one.photo):
        if (alike := (other * one.render).sum()) > best:
            best, how = alike, words
    return how if 1 - best < LESS * (1 - own) else None


def turnings(picture):
    """(how in words, the picture) turned by right angles and mirrored, in all ways."""
    for times, mirrored in itertools.product(range(4), (False, True)):
        words = ["mirrored"] * mirrored + [f"by {90 * times} degrees"] * (times > 0)
        if words:
            other = np.rot90(picture[:, ::-1] if mirrored else picture, times)
            yield ", ".join(words), other


def strange(names, photos, renders, undone, main):
    """Views, of `main`, whose renders are of none of the photos."""
    chosen = [i for i, name in enumerate(names) if name in main]
    alike, own = renders @ photos.T, (undone * photos).sum(axis=1)
    is_single = len(names) == 1
    bad = {
        i for i in chosen if own[i] < ALIKE and (is_single or alike[i].max() > own[i])
    }
    if len(chosen) >= FEW and np.median(photos @ photos.T) < SAME:
        left = nearer(apart(photos), apart(renders), apart(undone))[chosen]
        if np.median(left) > FAR:
            bad = set(chosen)
    return [names[i] for i in sorted(bad)]


def apart(pictures):
    """Pictures [n, pixels] without what all have in common, of length 1."""
    left = pictures - pictures.mean(axis=0)
    return left / np.maximum(np.linalg.norm(left, axis=1, keepdims=True), 1e-6)


def nearer(photos, renders, undone):
    """Share [n] of all photos that are nearer to each render than its own."""
    own = (undone * photos).sum(axis=1, keepdims=True)
    others = ~np.eye(len(photos), dtype=bool)
    return ((renders @ photos.T > own) & others).mean(axis=1)


def sentence(checked: Checked):
    """What fails, with some names."""
    parts = []
    for kind, words in KINDS.items():
        own = {v: what for v, (one, what) in checked.faults.items() if one == kind}
        if own:
            few = ", ".join(f"{v} {what}".strip() for v, what in list(own.items())[:3])
            more = f" and {len(own) - 3} more" if len(own) > 3 else ""
            parts.append(f"{len(own)} of {checked.count} are {words} ({few}{more})")
    return f"renders are not those of their photos: {'; '.join(parts)}"


def advice(checked: Checked):
    """What to do about the fault that most have."""
    kinds = [kind for kind, _ in checked.faults.values()]
    return ADVICE[max(KINDS, key=kinds.count)]
