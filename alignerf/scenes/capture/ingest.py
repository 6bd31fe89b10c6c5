"""A folder of photos and films as COLMAP and the training want them: of one size.

COLMAP gets copies that are no larger than it looks at; the photos themselves are
decoded again where they are needed, and never copied in full.
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from alignerf.command import images, progress
from alignerf.scenes import photos, prepare
from alignerf.scenes.capture import orientation, video

# Focal lengths in EXIF are rounded to a millimetre: closer ones are the same zoom.
SAME_ZOOM = 0.04


class Taken(NamedTuple):
    """Photos of one size, sorted by name, with a copy <folder>/<name>.png of each."""

    names: list[str]
    paths: list[Path]
    lays: list[orientation.Lay]
    width: int
    height: int
    copy_width: int
    copy_height: int
    folder: Path
    focals_px: Float[np.ndarray, " n"]
    """From EXIF; NaN where a photo has none."""
    cameras: Int[np.ndarray, " n"]
    """Photos with one number have one camera; numbers go from 0."""
    background: str | None

    def load(self, i):
        """Photo i [height, width, 3] uint8."""
        image, _ = photos.decode(self.paths[i], self.background, upright=False)
        return self.lays[i].apply(image)

    def of_camera(self, number):
        """(names, the focal length in px that EXIF gives them or None)."""
        chosen = np.flatnonzero(self.cameras == number)
        known = self.focals_px[chosen][np.isfinite(self.focals_px[chosen])]
        focal_px = float(np.median(known)) if len(known) else None
        return [self.names[i] for i in chosen], focal_px


def ingest(folder, work_folder, *, background=None, most_side_px=1600) -> Taken:
    """Look through a folder, and decode every photo once to be sure that it is whole.

    Films become frames, in <work_folder>/frames. background: as of `photos.decode`.
    most_side_px: of the copies. Raises ValueError naming the file for what is broken,
    and what differs in size before anything is decoded.
    """
    work_folder = Path(work_folder)
    paths = find(folder, work_folder)
    names = [path.stem for path in paths]
    heads = [photos.head(path) for path in paths]
    (width, height), lays = orientation.lay_alike(
        [path.name for path in paths],
        [(head.size, head.orientation) for head in heads],
        folder,
    )
    shrunk = min(1.0, most_side_px / max(width, height))
    copy_size = round(shrunk * width), round(shrunk * height)
    copies = work_folder / "copies"
    copies.mkdir()
    focals_px = []
    for path, lay in progress.over(list(zip(paths, lays, strict=True)), "photos"):
        image, focal_px = photos.decode(path, background, upright=False)
        focals_px.append(focal_px)
        small = prepare.shrink(lay.apply(image), *copy_size)
        images.write(copies / f"{path.stem}.png", small)
    focals_px = np.array(focals_px)
    kinds = [lay.kind for lay in lays]
    return Taken(
        names=names,
        paths=paths,
        lays=lays,
        width=width,
        height=height,
        copy_width=copy_size[0],
        copy_height=copy_size[1],
        folder=copies,
        focals_px=focals_px,
        cameras=share_cameras(kinds, focals_px),
        background=background,
    )


def find(folder, work_folder):
    """Paths of all photos and frames, by view name; ValueError where there is none."""
    films = video.find(folder)
    alone = films == [Path(folder)]
    paths = [] if alone else photos.find_images(folder, others=films)
    for film in films:
        frames = work_folder / "frames"
        frames.mkdir(exist_ok=True)
        paths += video.extract(film, frames)
    paths = sorted(paths, key=lambda path: path.stem)
    photos.check_names(paths, folder)
    return paths


def share_cameras(kinds, focals_px):
    """Numbers [n]: photos that lie alike and have one zoom share one.

    Where zooms differ from photo to photo, each has a camera of its own.
    """
    kinds = np.array(kinds)
    keys = np.empty(len(kinds), object)
    for kind in dict.fromkeys(kinds):
        for i in np.flatnonzero(kinds == kind):
            keys[i] = (kind, zoom_of(focals_px[i], focals_px[kinds == kind]))
    known = list(dict.fromkeys(keys))
    if len(known) > max(2, len(keys) // 3):
        return np.arange(len(keys))
    return np.array([known.index(key) for key in keys])


def zoom_of(focal_px, all_px):
    """The shortest focal length of the zoom that one belongs to, of all of its kind.

    One that is not known has the zoom of the others, if they have one.
    """
    first = []
    for one in np.sort(all_px[np.isfinite(all_px)]):
        if not first or one > first[-1] * (1 + SAME_ZOOM):
            first.append(float(one))
    if np.isnan(focal_px):
        return first[0] if len(first) == 1 else 0.0
    return max(one for one in first if one <= focal_px)
