"""A folder of photos, videos and masks, as COLMAP and the training want them.

COLMAP gets copies that are no larger than it looks at; the photos themselves are
decoded again where they are needed, and never copied in full.

A phone stores what its sensor saw and writes into EXIF how the phone was held. Turned
upright, its photos have two shapes and two cameras; as stored they have one. So all are
turned as most of them are. Notation: `orientation` is EXIF's, 1 to 8; a turn is a
quarter of a circle, clockwise.
"""

import logging
import os
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float, Int

from alignerf.colmap import video
from alignerf.io import faults, images, progress
from alignerf.scenes import held_out, photo_names, photos, prepare

log = logging.getLogger(__name__)

# Focal lengths in EXIF are rounded to a millimetre: closer ones are the same zoom.
SAME_ZOOM = 0.04
# Masks that hide more than this are meant the other way round; by so many it is told.
NEARLY_ALL, SOME_MASKS = 0.8, 8
# Those without a mirror, and the turns that they ask for.
TURNS = {1: 0, 6: 1, 3: 2, 8: 3}


class Lay(NamedTuple):
    """The turns that make a photo lie as the others do."""

    # EXIF's orientation that is applied to the rows as stored.
    orientation: int
    # Then a turn back, for photos that lie across without EXIF's word.
    across: bool
    # Turns that make the result upright.
    turns: int
    # Photos of one kind may share a camera.
    kind: str

    def apply(self, image):
        """Rows as stored [h, w, 3] -> as all photos lie."""
        image = photos.UPRIGHT[self.orientation](image)
        image = np.rot90(image) if self.across else image
        return np.ascontiguousarray(image)


class Taken(NamedTuple):
    """Photos, sorted by name, with a copy <folder>/<name>.png of each."""

    names: list[str]
    paths: list[Path]
    lays: list[Lay]
    sizes: list[tuple[int, int]]
    """(width, height) of each photo as it lies."""
    copy_sizes: list[tuple[int, int]]
    folder: Path
    focals_px: Float[np.ndarray, " n"]
    """From EXIF; NaN where a photo has none."""
    cameras: Int[np.ndarray, " n"]
    """Photos with one number have one camera; numbers go from 0."""
    background: str | None
    masks: list[Path | None]
    """Of each photo, where there is one."""

    def load(self, i):
        """Photo i [height, width, 3] uint8."""
        return self.lays[i].apply(photos.as_stored(self.paths[i], self.background))

    def load_mask(self, i):
        """An image like photo i: 255 where its mask is not black, else 0."""
        if self.masks[i] is None:
            return np.full((*self.sizes[i][::-1], 3), 255, np.uint8)
        return self.lays[i].apply(read_mask(self.masks[i], self.paths[i]))

    def camera(self, number):
        """The Camera of a number."""
        chosen = np.flatnonzero(self.cameras == number)
        known = self.focals_px[chosen][np.isfinite(self.focals_px[chosen])]
        return Camera(
            names=[self.names[i] for i in chosen],
            size=self.sizes[chosen[0]],
            copy_size=self.copy_sizes[chosen[0]],
            focal_px=float(np.median(known)) if len(known) else None,
        )


class Camera(NamedTuple):
    """Photos that one camera took; sizes are (width, height)."""

    names: list[str]
    size: tuple[int, int]
    copy_size: tuple[int, int]
    # Of the photos, as EXIF gives it.
    focal_px: float | None

    def of_copies(self):
        """The same camera, of the copies."""
        shrunk = np.array(self.copy_size) / self.size
        focal_px = None if self.focal_px is None else self.focal_px * shrunk.mean()
        return self._replace(size=self.copy_size, focal_px=focal_px)


def ingest(
    folder, work_folder, *, background=None, max_side_px=1600, masks=None
) -> Taken:
    """Read a folder, and decode every photo once to be sure that none is broken.

    Videos become frames, in <work_folder>/frames. background: as of `photos.decode`.
    max_side_px: of the copies. masks: a folder of <photo's file name>.png, black where
    a photo does not count; a photo without one counts everywhere. Raises ValueError
    naming the file for what is broken.
    """
    work_folder = Path(work_folder)
    taken = once_more(folder, work_folder, background=background, masks=masks)
    copies = work_folder / "copies"
    copies.mkdir()
    copy_sizes, focals_px, kinds = [], [], []
    each = zip(taken.names, taken.paths, taken.sizes, taken.lays, strict=True)
    for name, path, size, lay in progress.over(each, "photos", total=len(taken.paths)):
        image, focal_px = photos.decode(path, background, upright=False)
        shrunk = min(1.0, max_side_px / max(size))
        copy_sizes.append((round(shrunk * size[0]), round(shrunk * size[1])))
        focals_px.append(focal_px)
        small = prepare.shrink(lay.apply(image), *copy_sizes[-1])
        images.write(copies / f"{name}.png", small)
        # Frames of a video are by its camera, which may be cut otherwise than photos'.
        is_frame = path.parent.parent == work_folder
        camera = path.stem.rpartition("_")[0] if is_frame else photos.head(path).camera
        # Photos of several cameras lie in a folder each.
        kinds.append((lay.kind, camera, path.parent))
    taken = taken._replace(
        copy_sizes=copy_sizes,
        folder=copies,
        focals_px=np.array(focals_px),
        cameras=share_cameras(kinds, np.array(focals_px)),
    )
    if masks is not None:
        write_copies_of_masks(taken, work_folder / "copies_masks")
    return taken


def once_more(folder, work_folder, *, background=None, masks=None) -> Taken:
    """A folder that `ingest` has read, without decoding photos, and without copies.

    Focal lengths and cameras are unknown.
    """
    found = find(folder, Path(work_folder))
    paths = list(found.values())
    laid = lay_alike([photos.head(path)[:2] for path in paths])
    return Taken(
        names=list(found),
        paths=paths,
        lays=[lay for _, lay in laid],
        sizes=[size for size, _ in laid],
        copy_sizes=[],
        folder=Path(folder),
        focals_px=np.full(len(paths), np.nan),
        cameras=np.zeros(len(paths), int),
        background=background,
        masks=find_masks(masks, paths, folder),
    )


def find_masks(folder, paths, root=None):
    """The mask of each photo in a folder of <photo's file name>.png, else None.

    So COLMAP calls them; <view>.png will do too. root: the folder of the photos, whose
    folders the masks' may repeat. Photos without a mask, what is the mask of no photo,
    and masks that hide nearly all are named in a warning. Raises ValueError where there
    is no mask of any photo.
    """
    if folder is None:
        return [None] * len(paths)
    folder = Path(folder)
    if not folder.is_dir():
        raise ValueError(f"no folder of masks at {folder}")
    # COLMAP's have the photo's own suffix before theirs.
    of_photo = {
        path[:-4] if Path(path[:-4]).suffix.lower() in photos.SUFFIXES else path: path
        for path in photo_names.listed(folder, frozenset([".png"]))
    }
    names = [os.path.relpath(path, root or path.parent) for path in paths]
    found = photo_names.match(names, of_photo)
    masks = [folder / of_photo[found[n]] if n in found else None for n in names]
    others = photo_names.listed(folder, photos.SUFFIXES - {".png"})
    if not any(masks):
        why = f": save {faults.name_of(others[0])} as .png" if others else ""
        raise ValueError(f"{folder}: no mask <photo's file name>.png of any photo{why}")
    if bare := [n for n, mask in zip(names, masks, strict=True) if not mask]:
        few = faults.some_names(bare)
        log.warning("%s: no mask of %s: all of it is learned from", folder, few)
    # What they hide would be learnt from without a word.
    strange = [of_photo[one] for one in of_photo.keys() - {*found.values()}]
    if strange := sorted([*strange, *others]):
        few = faults.some_names(strange)
        log.warning("%s: the mask of no photo, and left out: %s", folder, few)
    warn_of_inverted(folder, [mask for mask in masks if mask])
    return masks


def warn_of_inverted(folder, masks):
    """Warn of masks that hide nearly all of their photos, by some of them."""
    some = masks[:: max(len(masks) // SOME_MASKS, 1)][:SOME_MASKS]
    shares = [
        (photos.as_stored(mask, "black") == 0).all(axis=-1).mean() for mask in some
    ]
    if (hidden := float(np.median(shares))) > NEARLY_ALL:
        log.warning(
            "%s: masks hide %.0f %% of their photos: black is what does not count; are "
            "these inverted?",
            *(folder, 100 * hidden),
        )


def read_mask(path, photo, upright=False):
    """A mask [h, w, 3] uint8, 0 or 255, at its photo's size; its rows as the photo's.

    upright: EXIF's orientation of the photo is applied to both. A mask may be smaller
    or larger, or turned as EXIF turns the photo; ValueError for one of another shape.
    """
    head = photos.head(photo)
    size, orientation = head.size, head.orientation
    counts = (photos.as_stored(path, "black") > 0).any(axis=-1)
    own = counts.shape[::-1]
    if not prepare.has_shape(own, size):
        if not head.lies_as(own):
            raise ValueError(
                f"{path} is {own[0]}x{own[1]}, its photo {size[0]}x{size[1]}"
            )
        counts = photos.UPRIGHT[photos.UNDONE_BY[orientation]](counts)
    counts = cv2.resize(counts.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    return images.of_mask(
        (photos.UPRIGHT[orientation] if upright else np.array)(counts)
    )


def write_copies_of_masks(taken, folder):
    """Masks of the copies, as COLMAP looks for them."""
    folder.mkdir()
    for i, name in enumerate(taken.names):
        mask = taken.load_mask(i)
        if not mask.any():
            raise ValueError(
                f"{taken.masks[i]}: it hides the whole photo: leave one out"
            )
        mask = prepare.shrink(mask, *taken.copy_sizes[i])
        images.write(folder / f"{name}.png.png", mask)


def find(folder, work_folder):
    """{view: path} of all photos and frames, sorted; ValueError where there is none."""
    videos = video.find(folder)
    alone = videos == [Path(folder)]
    found = {} if alone else photos.find_images(folder, others=videos)
    videos = video.without_live_photos(videos, found.values())
    for one in videos:
        frames = work_folder / "frames"
        frames.mkdir(exist_ok=True)
        for path in video.extract(one, frames):
            if path.stem in found:
                raise ValueError(
                    f"{folder}: {faults.name_of(found[path.stem].name)} and a frame of "
                    f"{one.name} have the same view name, {path.stem}"
                )
            found[path.stem] = path
    every = [found[name] for name in sorted(found)]
    photos.check_pinhole(every, folder)
    kept = held_out.without_copies(every, folder)
    names = {path: name for name, path in found.items()}
    return {names[path]: path for path in kept}


def share_cameras(kinds, focals_px):
    """Numbers [n]: photos that lie alike and have one zoom share one.

    Where zooms differ from photo to photo, each has a camera of its own.
    """
    keys = []
    for kind, focal_px in zip(kinds, focals_px, strict=True):
        alike = np.array([other == kind for other in kinds])
        keys.append((kind, zoom_of(focal_px, focals_px[alike])))
    known = list(dict.fromkeys(keys))
    if len(known) > max(2, len(keys) // 3):
        return np.arange(len(keys))
    return np.array([known.index(key) for key in keys])


def zoom_of(focal_px, all_px):
    """The shortest focal length of the zoom that a photo belongs to.

    all_px: the focal lengths of all photos of its kind. A photo of unknown focal length
    has the zoom of the others, if they share one; else 0 is returned.
    """
    first = []
    for one in np.sort(all_px[np.isfinite(all_px)]):
        if not first or one > first[-1] * (1 + SAME_ZOOM):
            first.append(float(one))
    if np.isnan(focal_px):
        return first[0] if len(first) == 1 else 0.0
    return max(one for one in first if one <= focal_px)


def upright_size(size, orientation):
    """(width, height) after an orientation is applied."""
    return size[::-1] if orientation in photos.SIDEWAYS else size


def lay_alike(heads):
    """((width, height), Lay) of each photo, laid like the others.

    heads: (stored (width, height), orientation) of each photo. Photos of another size
    lie with their longer side as most photos have it.
    """
    plain = Counter(o for _, o in heads if o in TURNS)
    # Of equally many the least: 1, as stored.
    common = min(plain, key=lambda o: (-plain[o], o)) if plain else 1
    shapes = Counter(upright_size(s, common if o in TURNS else o) for s, o in heads)
    usual = max(shapes, key=lambda size: (shapes[size], size))
    return [_lay(size, o, common, usual) for size, o in heads]


def _lay(size, orientation, common, usual):
    """((width, height), Lay) of one photo: as most lie, where it can."""
    if orientation in TURNS and upright_size(size, common) == usual:
        turns = (TURNS[orientation] - TURNS[common]) % 4
        return usual, Lay(common, False, turns, "sensor")
    own = upright_size(size, orientation)
    if own == usual:
        return usual, Lay(orientation, False, 0, "upright")
    kind = "" if own == usual[::-1] else f"{max(own)}x{min(own)}"
    if (own[0] < own[1]) == (usual[0] < usual[1]) or own[0] == own[1]:
        return own, Lay(orientation, False, 0, kind)
    return own[::-1], Lay(orientation, True, 1, f"{kind} across".strip())
