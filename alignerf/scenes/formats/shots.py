"""What readers of cameras share: shots, their views, and checked numbers."""

import functools
import itertools
import logging
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.io import faults
from alignerf.scenes import cameras, held_out, photos, prepare
from alignerf.scenes.capture import canvas, ingest

log = logging.getLogger(__name__)

# Of any number in a file.
LARGEST = 1e12
# Numbers may be of photos so many times as large, whose middle lies as near to the
# principal point, as a share.
TIMES, NEAR_MIDDLE = (2, 4, 8, 1 / 2, 1 / 4, 1 / 8), 0.15
# Of the frames of a film.
MAX_FRAMES = 120


class Shot(NamedTuple):
    """A photo with the camera that came with it."""

    name: str
    photo: Path
    camtopix: np.ndarray
    """[3, 3], pixel centres at +0.5, of a photo of `size`."""
    size: tuple[float, float] | None
    """(width, height); None where the file does not say, so it is the photo's."""
    camtoworld: np.ndarray
    """[3, 4], OpenGL axes; its rotation as the file has it, which may be scaled."""
    distortion: np.ndarray = np.zeros(5)
    mask: Path | None = None


def views_of(
    shots, where, *, crop_px=0, background=None, masks=None, root=None
) -> prepare.PosedViews:
    """The undistorted views of shots, in their order.

    Their size is that of the photos less `crop_px` at each border; photos of several
    sizes are laid on one canvas. Rows are taken as stored, as cameras of others mean
    them, or upright where only that fits a camera's size. masks, root: as of
    `ingest.find_masks`; None: those of the shots. where: the file or folder, named in a
    ValueError for photos that are broken or not of their camera's shape, and as of
    `cameras.nearest_rotations`.
    """
    given = np.stack([shot.camtoworld for shot in shots])
    poses = cameras.nearest_rotations(where, [shot.name for shot in shots], given)
    if masks:
        paths = [shot.photo for shot in shots]
        each = zip(shots, ingest.find_masks(masks, paths, root), strict=True)
        shots = [shot._replace(mask=mask) for shot, mask in each]
    of_file = {}
    for shot, pose in zip(shots, given, strict=True):
        # A file may be linked under two names.
        at = held_out.identity(shot.photo)
        name, other = of_file.setdefault(at, (shot.name, pose))
        if not np.array_equal(pose, other):
            both = f"{faults.name_of(name)} and {faults.name_of(shot.name)}"
            raise ValueError(f"{where}: one photo at two poses: {both}")
    sizes = [photos.head(shot.photo).size for shot in shots]
    usual = prepare.usual_size(sizes)
    stated, shots = [shot.size for shot in shots], of_own_size(shots, usual)
    across = [shot.size[0] / size[0] for shot, size in zip(shots, sizes, strict=True)]
    if not 1 / TIMES[0] < (times := float(np.median(across))) < TIMES[0]:
        log.info("%s: cameras of photos %.3g times as large", where, times)
    each = zip(shots, stated, strict=True)
    other = [shot.size[0] / size[0] for shot, size in each if size and size[0]]
    if (times := float(np.median(other)) if other else 1.0) != 1:
        log.warning(
            "%s: focal length and principal point are of a photo %.3g times as large "
            "as the width and height that it says: scaled",
            *(where, times),
        )
    if beside := [shot.name for shot in shots if is_beside(shot)]:
        log.warning(
            "%s: the principal point lies beside the photo, as in numbers of a larger "
            "one: %s",
            *(where, faults.some_names(beside)),
        )
    each = zip(shots, sizes, strict=True)
    turned = dict.fromkeys(shot.name for shot, size in each if is_turned(shot, size))
    if turned:
        few = faults.some_names([*turned])
        log.warning(
            "%s: cameras of photos turned upright, as EXIF says: %s", where, few
        )
    lenses, pictures, hidden = [], [], []
    for i, shot in enumerate(shots):
        up = shot.name in turned
        size = sizes[i] = sizes[i][::-1] if up else sizes[i]
        scale = prepare.true_scale(shot.size, size, where=f"{where}: {shot.photo}")
        lenses.append((cropped_by(crop_px) @ scale @ shot.camtopix, shot.distortion))
        steps = (functools.partial(cropped, crop_px=crop_px),) if crop_px else ()
        pictures.append(prepare.Photo(shot.photo, (reader(background, up), *steps)))
        read_mask = functools.partial(ingest.read_mask, photo=shot.photo, upright=up)
        hidden.append(
            prepare.Photo(shot.mask, (read_mask, *steps))
            if shot.mask
            else prepare.all_count(*size)
        )
    # One of another shape may be a gigabyte: these are refused before.
    photos.check_whole([shot.photo for shot in shots], background)
    sizes = [tuple(side - 2 * crop_px for side in size) for size in sizes]
    if len(set(sizes)) > 1:
        each = [f"{n} of {w}x{h}" for (w, h), n in Counter(sizes).most_common()]
        log.warning("%s: photos of several sizes: %s", where, faults.some_names(each))
    if min(small := min(sizes, key=min)) < prepare.MIN_SIZE_PX:
        raise ValueError(f"{where}: photos of {small[0]}x{small[1]} are too small")
    views = canvas.views_of(
        [shot.name for shot in shots],
        lenses,
        sizes,
        poses,
        camera_of=[0] * len(shots),
        photos=pictures,
        masks=hidden if any(shot.mask for shot in shots) else None,
        where=where,
    )
    place = {name: i for i, name in enumerate(views.names)}
    return prepare.select(views, [place[shot.name] for shot in shots])


def times_of(centre, size):
    """How many times a photo's (width, height) numbers are of, that do not say it.

    One of TIMES, where the middle of such a photo is near the principal point; else 1.
    """
    across = 2 * np.array(centre) / size
    fits = (n for n in TIMES if np.abs(across / n - 1).max() < NEAR_MIDDLE)
    return next(fits, 1)


def is_beside(shot):
    """Whether a camera's principal point is none of its photo's."""
    centre = shot.camtopix[:2, 2]
    return bool(((centre < 0) | (centre > shot.size)).any())


def is_turned(shot, size):
    """Whether a camera is of its photo turned upright, and not as it is stored."""
    if min(shot.size) <= 0 or prepare.has_shape(size, shot.size):
        return False
    if not prepare.has_shape(size[::-1], shot.size):
        return False
    if photos.head(shot.photo).orientation in photos.SIDEWAYS:
        return True
    raise ValueError(
        f"{shot.photo} is {size[0]}x{size[1]}, its camera {shot.size[0]:g}x"
        f"{shot.size[1]:g}: they are turned against each other"
    )


def reader(background, upright):
    """What reads a photo [h, w, 3] from its path."""
    read = photos.upright if upright else photos.as_stored
    return functools.partial(read, background=background)


def cropped_by(crop_px):
    """[3, 3] from a photo's pixels to those of the photo less a border."""
    return np.array([[1.0, 0, -crop_px], [0, 1, -crop_px], [0, 0, 1]])


def cropped(image, crop_px):
    return np.ascontiguousarray(image[crop_px:-crop_px, crop_px:-crop_px])


def of_own_size(shots, usual):
    """The shots with the (width, height) that their numbers are of, whatever they say.

    usual: that of most photos, for a shot that does not say. Smaller ones are those of
    all shots or of none: a crop may have a principal point like theirs.
    """
    sizes = [shot.size or usual for shot in shots]
    times = [
        times_of(shot.camtopix[:2, 2], size) if min(size) > 0 else 1
        for shot, size in zip(shots, sizes, strict=True)
    ]
    if len({*times}) > 1:
        times = [max(one, 1) for one in times]
    each = zip(shots, sizes, times, strict=True)
    return [shot._replace(size=(n * size[0], n * size[1])) for shot, size, n in each]


def photos_in(folder, pattern="*"):
    """{stem: path} of the photos of a folder; ValueError for two of one stem."""
    visible = [p for p in Path(folder).glob(pattern) if not p.name.startswith(".")]
    named = [p for p in visible if p.suffix.lower() in photos.SUFFIXES]
    if gone := sorted(path.name for path in named if not path.is_file()):
        log.warning("%s: ignored %s: no files", folder, faults.some_names(gone))
    return photos.by_view([p for p in named if p.is_file()], Path(folder))


def evenly(frames, where):
    """MAX_FRAMES of a film's frames at most, which is said."""
    if len(frames) <= MAX_FRAMES:
        return frames
    log.info("%s: %d of %d frames, evenly", where, MAX_FRAMES, len(frames))
    places = np.linspace(0, len(frames) - 1, MAX_FRAMES).round().astype(int)
    return [frames[place] for place in places]


def numbers(path, values, what, count):
    """[count] float64 of a value of an object that was read from `path`.

    what: its name in the ValueError for anything but so many numbers, all of them
    finite.
    """
    fits = isinstance(values, list) and len(values) == count
    if not fits or not all(map(is_number, values)):
        raise ValueError(f"{path}: {what} must be a list of {count} numbers")
    return np.array(values, dtype=np.float64)


def is_number(value):
    """Whether a value of a JSON is a finite number of a sensible size."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) < LARGEST


def pinhole(path, values, *, where, centre_px=0.0):
    """Intrinsics [3, 3] of (fx, fy, cx, cy) in px.

    centre_px: added to the principal point. Raises ValueError naming the file and
    `where` for a focal length that is not positive.
    """
    fx, fy, cx, cy = map(float, values)
    if min(fx, fy) <= 0:
        raise ValueError(f"{path}: the focal length of {where} is not positive")
    return np.array([[fx, 0, cx + centre_px], [0, fy, cy + centre_px], [0, 0, 1]])


def rotation_of(quaternion):
    """Rotation [3, 3] of (x, y, z, w), times its length."""
    length = np.linalg.norm(quaternion)
    x, y, z, w = quaternion / (length or 1)
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return length * (np.eye(3) + 2 * (w * across + across @ across))


def check_apart(shots, where):
    """ValueError where a phone has not tracked itself: all poses are one."""
    poses = [shot.camtoworld for shot in shots]
    if len(poses) > 1 and all(
        np.array_equal(a, b) for a, b in itertools.pairwise(poses)
    ):
        raise ValueError(
            f"{where}: all {len(poses)} poses are the same: the phone did not track "
            "itself, as with the front camera"
        )
