"""The cameras of a file and the views of their photos, and what all readers share.

A reader makes `Cameras` of a file. `placed` gives each the photo that it is of, by one
rule for photos that are missing; `views_of` makes undistorted views of both.
"""

import functools
import itertools
import logging
import math
import os
import posixpath
import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alignerf.colmap import canvas, ingest, structure
from alignerf.io import faults, json_files
from alignerf.scenes import cameras as scene_cameras
from alignerf.scenes import held_out, photo_names, photos, prepare

log = logging.getLogger("alignerf")

# Numbers may be of photos so many times as large, whose middle lies as near to the
# principal point, as a share.
TIMES, NEAR_MIDDLE = (2, 4, 8, 1 / 2, 1 / 4, 1 / 8), 0.15
# Of the frames of a film.
MAX_FRAMES = 120
# Some files leave the suffix away.
SUFFIXES = ("", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG")
SMALLER = re.compile(r"images_([1-9][0-9]?)")


class Shot(NamedTuple):
    """The camera of a photo; once `sized`, its lens and size are what they are."""

    name: str
    """Of the photo, as the file has it; then of its view."""
    lens: Callable | tuple
    """(camtopix [3, 3], distortion) with pixel centers at +0.5, of a photo of `size`;
    or a function of a size that gives it."""
    pose: np.ndarray
    """Camera-to-world [3, 4], OpenGL axes."""
    size: tuple[float, float] | None = None
    """(width, height); None where the file does not say."""
    is_own: bool = False
    """Whether it is the photo's own then, where most have another shape."""
    photo: Path | None = None
    mask: str | Path | None = None
    split: str | None = None
    head: photos.Head | None = None
    """The photo's, once `sized`."""

    def of_size(self, size):
        """The lens of a photo of a (width, height) that its numbers are of."""
        return self.lens(size) if callable(self.lens) else self.lens

    def at(self, size, where):
        """The lens at the photo's (width, height); ValueError as of `true_scale`."""
        camtopix, distortion = self.lens
        return prepare.true_scale(self.size, size, where=where) @ camtopix, distortion


class Cameras(NamedTuple):
    """The shots of a file or folder, and what else it says.

    kind: what file it is, in words. points: positions [m, 3] and colours; ply: the path
    of a file of them, as the file has it. applied: nerfstudio's `applied_transform` [4,
    4] that is in the poses. left_out: photos whose pose is none; once cameras are
    `placed`, views of photos without a camera and of cameras without a photo. root: the
    photos' folder then.
    """

    where: Path
    shots: list[Shot]
    kind: str = ""
    points: tuple | None = None
    ply: str | None = None
    applied: np.ndarray | None = None
    root: Path | None = None
    left_out: Sequence[str] = ()

    @property
    def splits(self):
        """{name: split}, where that of all is known; else None."""
        found = {shot.name: shot.split for shot in self.shots}
        return found if all(found.values()) else None


def cameras(where, found, kind="", **more) -> Cameras:
    """`Cameras` of shots, whose rotations may be inexact; ValueError without any."""
    if not found:
        raise ValueError(f"{where}: no camera has a pose")
    names, poses = [shot.name for shot in found], np.stack([s.pose for s in found])
    poses = scene_cameras.nearest_rotations(where, names, poses)
    found = [s._replace(pose=pose) for s, pose in zip(found, poses, strict=True)]
    return Cameras(where, found, kind, **more)


def placed(
    own: Cameras, roots, *, among=None, partial=False, choose=None, is_told=False
):
    """The `Cameras` with their photos, by the names of their views.

    roots: folders that photos may lie in, the likeliest first. among: the photos there,
    relative to it; None: all. What is missing is said; ValueError where that is over
    `photo_names.MAX_MISSING` of them, or one to be scored; `partial`: where it is all.
    choose: `sfm.pairing.choose`, which asks photos where the file does not tell their
    place (`is_told`, of the first root).
    """
    names = list(dict.fromkeys(shot.name for shot in own.shots))
    found = photos_of(own, names, roots, among, is_told)
    root, photo_of = found[0]
    gone = [name for name in names if name not in photo_of]
    lost = [shot for shot in own.shots if shot.name not in photo_of]
    scored = [shot.name for shot in lost if shot.split == "test"]
    few = faults.some_names(scored or gone)
    too_many = not partial and len(gone) > photo_names.MAX_MISSING * len(names)
    if not photo_of or too_many or (scored and not partial):
        raise ValueError(
            f"{root}: no photo {few}, which {own.where} has a pose for"
            f"{elsewhere(root, gone[:20], among)}"
        )
    if gone:
        log.warning(
            "%s: no photo of %d of %d cameras: %s",
            *(own.where, len(gone), len(names), few),
        )
    there = [shot for shot in own.shots if shot.name in photo_of]
    there = [shot._replace(photo=photo_of[shot.name]) for shot in there]
    there = sized(own.where, without_copies(own.where, there), root)
    at_place = is_told and all(shot.photo == at(root, shot.name) for shot in there)
    if choose and not at_place:
        k, there = choose(own.where, there, [photos_at for _, photos_at in found])
        root, photo_of = found[k]
        paths = [photo_of[shot.name] for shot in there]
        each = zip(there, paths, map(photos.head, paths), strict=True)
        there = [shot._replace(photo=photo, head=head) for shot, photo, head in each]
    folders = {shot.photo.parent for shot in there}
    beside = among
    if among is None:
        # Where the file tells places, of other photos it says nothing.
        bare = named(list(dict.fromkeys(own.left_out)), root).values()
        bare = [path.relative_to(root).as_posix() for path in bare]
        beside = bare if is_told else photo_names.listed(root)
    beside = [path for path in beside if (root / path).parent in folders]
    views = photos.by_view([shot.photo for shot in there], root, beside)
    view_of = {path: view for view, path in views.items()}
    every = photo_names.view_names(beside)
    unposed = [every[path] for path in beside if root / path not in view_of]
    if unposed:
        log.warning("%s: no pose of %s", own.where, faults.some_names(unposed))
    gone = photo_names.view_names([name.replace("\\", "/") for name in gone])
    there = [shot._replace(name=view_of[shot.photo]) for shot in there]
    return own._replace(
        shots=there, root=root, left_out=sorted([*unposed, *gone.values()])
    )


def photos_of(own: Cameras, names, roots, among, is_told):
    """[(folder, {name: path})]: that where most photos lie.

    Of those with all, each whose photos are as large as the cameras, which are those of
    undistorted photos or of the originals.
    """
    sizes = {shot.name: shot.size for shot in own.shots}
    best, whole = (Path(roots[-1]), {}), {}
    for root in filter(Path.is_dir, dict.fromkeys(map(Path, roots))):
        # Above a folder with all of them the same ones are found.
        if any(other.is_relative_to(root) for other, _ in whole.values()):
            continue
        photo_of = named(names, root, among, own.where)
        if is_told and photo_of:
            return [(root, photo_of)]
        if len(photo_of) > len(best[1]):
            best = root, photo_of
        if len(photo_of) == len(names) and is_as_large(sizes, photo_of):
            whole.setdefault(faults.resolved(root), (root, photo_of))
    return [*whole.values()] or [best]


def is_as_large(sizes, photo_of):
    """Whether the first photo is as large as its camera; not so a broken one."""
    name, path = next(iter(photo_of.items()))
    try:
        return sizes[name] in (None, photos.head(path).size)
    except ValueError:
        return False


def named(names, root, among=None, where=None):
    """{name: path}: where a name says, else by `photo_names.match`."""
    found = {}
    if among is None:
        found = {name: path for name in names if (path := at(root, name))}
    if len(found) < len(names):
        every = photo_names.listed(root) if among is None else among
        others = photo_names.match(names, every, where)
        others = {name: root / path for name, path in others.items()}
        taken = {*found.values()}
        found = {n: path for n, path in others.items() if path not in taken} | found
    return {name: found[name] for name in names if name in found}


def at(root, name):
    """The file at the place that a name says, or None; none outside of the root."""
    # By name, not resolved: a link inside the folder is the user's own decision.
    plain = posixpath.normpath(name.replace("\\", "/"))
    if plain.startswith((f"{os.pardir}/", "/")):
        return None
    bare = plain.lower().endswith(tuple(photo_names.SUFFIXES))
    for suffix in SUFFIXES[: 1 if bare else None]:
        # Of a name that is too long, or holds a zero, there is no file.
        if os.path.isfile(place := os.path.join(root, plain + suffix)):
            return Path(place)
    return None


def elsewhere(root, names, among):
    """What photos there are in place of those that are gone, in words."""
    inside = Path(os.path.normpath(root.absolute()))
    said = {os.path.normpath(Path(inside, name).parent) for name in names}
    beside = (inside.parent / name for name in sorted(names_in(inside.parent)))
    for place in map(Path, [*sorted(said), *beside]):
        is_outside = not place.is_relative_to(inside)
        if is_outside and photo_names.match(names, names_in(place)):
            return f". Photos so called lie in {place}: move or link it into that"
    others = photo_names.listed(root) if among is None and root.is_dir() else among
    return f" (there are {faults.some_names(others)})" if others else ""


def names_in(folder):
    """Names of all that lies in a folder; none of what is no folder, or not to read."""
    try:
        return os.listdir(folder)
    except (OSError, ValueError):
        return []


def without_copies(where, found):
    """The shots, of equal ones of one photo the first, which is said.

    A file may be linked under two names. Raises ValueError naming two that differ, or
    of which one is trained on and one is scored.
    """
    first, twice = {}, []
    for shot in found:
        other = first.setdefault(held_out.identity(shot.photo), shot)
        if other is shot:
            continue
        of_split = {one.split: one.photo for one in (other, shot)}
        if of_split.keys() == {"train", "test"}:
            both = held_out.told(of_split, ("train", "test"))
            raise ValueError(f"{where}: {both}, are one file. {held_out.SO}")
        size = shot.size or photos.head(shot.photo).size
        of_both = [(s.pose, *s.of_size(size), s.size or size) for s in (other, shot)]
        if not all(map(np.array_equal, *of_both)):
            both = f"{faults.name_of(other.name)} and {faults.name_of(shot.name)}"
            raise ValueError(f"{where}: one photo at two poses: {both}")
        twice.append(shot.name)
    if twice:
        few = faults.some_names(twice)
        log.warning("%s: are there twice: the first is taken: %s", where, few)
    return list(first.values())


def sized(where, found, root=None):
    """The shots with the (width, height) that their numbers are of, and their lenses.

    Where the file does not say, that of most photos; in images_<n>, n times as much.
    What it says may be wrong: the principal point tells. Smaller ones are those of all
    shots or of none, as a crop may have a principal point like theirs.
    """
    heads = [shot.head or photos.head(shot.photo) for shot in found]
    usual = prepare.usual_size([head.size for head in heads])
    smaller = SMALLER.fullmatch(Path(root).name) if root else None
    n, sizes = int(smaller[1]) if smaller else 1, []
    for shot, head in zip(found, heads, strict=True):
        alike = prepare.has_shape(head.size, usual) or head.lies_as(usual)
        own = head.size if shot.is_own and not alike else usual
        sizes.append(shot.size or tuple(n * side for side in own))
    lenses = [shot.of_size(size) for shot, size in zip(found, sizes, strict=True)]
    times = [
        times_of(lens[0][:2, 2], size) if min(size) >= 1 else 1
        for lens, size in zip(lenses, sizes, strict=True)
    ]
    if len({*times}) > 1:
        times = [max(one, 1) for one in times]
    if (wrong := float(np.median(times))) != 1 and any(shot.size for shot in found):
        log.warning(
            "%s: focal length and principal point are of a photo %.3g times as large "
            "as the width and height that it says: scaled",
            *(where, wrong),
        )
    own = []
    for shot, head, size, many in zip(found, heads, sizes, times, strict=True):
        size = many * size[0], many * size[1]
        own.append(shot._replace(lens=shot.of_size(size), size=size, head=head))
    across = [shot.size[0] / shot.head.size[0] for shot in own]
    if not 1 / TIMES[0] < (wrong := float(np.median(across))) < TIMES[0]:
        log.info("%s: cameras of photos %.3g times as large", where, wrong)
    return own


def views_of(
    own: Cameras, *, crop_px=0, background=None, masks=None
) -> prepare.PosedViews:
    """The undistorted views of cameras with photos, in their order.

    Their size is that of the photos less `crop_px` at each border; photos of several
    sizes are laid on one canvas. Rows are taken as stored, as cameras of others mean
    them, or upright where only that fits a camera's size. masks: as of
    `ingest.find_masks`, where the cameras have none. Raises ValueError naming a photo
    of another shape than its camera; a broken one is named where it is read.
    """
    where, found = own.where, own.shots
    if not all(shot.head for shot in found):
        found = sized(where, without_copies(where, found))
    hidden = [shot.mask for shot in found]
    if masks and not any(hidden):
        hidden = ingest.find_masks(masks, [shot.photo for shot in found], own.root)
    if beside := [shot.name for shot in found if is_beside(shot)]:
        log.warning(
            "%s: the principal point lies beside the photo, as in numbers of a larger "
            "one: %s",
            *(where, faults.some_names(beside)),
        )
    if turned := [shot.name for shot in found if is_turned(shot)]:
        few = faults.some_names(turned)
        log.warning(
            "%s: cameras of photos turned upright, as EXIF says: %s", where, few
        )
    lenses, pictures, valid, sizes = [], [], [], []
    steps = (functools.partial(cropped, crop_px=crop_px),) if crop_px else ()
    for shot, mask in zip(found, hidden, strict=True):
        up = is_turned(shot)
        size = shot.head.size[::-1] if up else shot.head.size
        camtopix, distortion = shot.at(size, f"{where}: {shot.photo}")
        lenses.append((cropped_by(crop_px) @ camtopix, distortion))
        read = photos.upright if up else photos.as_stored
        read = functools.partial(read, background=background)
        pictures.append(prepare.Photo(shot.photo, (read, *steps)))
        read_mask = functools.partial(ingest.read_mask, photo=shot.photo, upright=up)
        all_count = prepare.all_count(*size)
        valid.append(prepare.Photo(mask, (read_mask, *steps)) if mask else all_count)
        sizes.append(tuple(side - 2 * crop_px for side in size))
    if len(set(sizes)) > 1:
        each = [f"{n} of {w}x{h}" for (w, h), n in Counter(sizes).most_common()]
        log.warning("%s: photos of several sizes: %s", where, faults.some_names(each))
    if min(small := min(sizes, key=min)) < prepare.MIN_SIZE_PX:
        raise ValueError(f"{where}: photos of {small[0]}x{small[1]} are too small")
    names = [shot.name for shot in found]
    views = canvas.views_of(
        names,
        lenses,
        sizes,
        np.stack([shot.pose for shot in found]),
        camera_of=[0] * len(found),
        photos=pictures,
        masks=valid if any(hidden) else None,
        where=where,
    )
    place = {name: i for i, name in enumerate(views.names)}
    views = prepare.select(views, [place[name] for name in names])
    splits = np.array([*own.splits.values()]) if own.splits else None
    return views._replace(points=own.points, split=splits)


def times_of(centre, size):
    """How many times a photo's (width, height) numbers are of, that do not say it.

    One of TIMES, where the middle of such a photo is near the principal point; else 1.
    """
    across = 2 * np.array(centre) / size
    fits = (n for n in TIMES if np.abs(across / n - 1).max() < NEAR_MIDDLE)
    return next(fits, 1)


def is_beside(shot):
    """Whether a camera's principal point is none of its photo's."""
    centre = shot.lens[0][:2, 2]
    return bool(((centre < 0) | (centre > shot.size)).any())


def is_turned(shot):
    """Whether a camera is of its photo turned upright, and not as it is stored."""
    if min(shot.size) <= 0:
        return False
    size, own = shot.head.size, shot.size
    if shot.head.lies_as(own):
        return True
    if prepare.has_shape(size, own) or not prepare.has_shape(size[::-1], own):
        return False
    raise ValueError(
        f"{shot.photo} is {size[0]}x{size[1]}, its camera {own[0]:g}x{own[1]:g}: they "
        "are turned against each other"
    )


def cropped_by(crop_px):
    """[3, 3] from a photo's pixels to those of the photo less a border."""
    return np.array([[1.0, 0, -crop_px], [0, 1, -crop_px], [0, 0, 1]])


def cropped(image, crop_px):
    return np.ascontiguousarray(image[crop_px:-crop_px, crop_px:-crop_px])


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


def lens(where, model, params):
    """(camtopix, distortion) of a camera of COLMAP's; ValueError naming `where`."""
    try:
        return structure.lens(model, np.array(params, np.float64))
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def pose(rotation, place):
    """Camera-to-world [3, 4], OpenGL axes, of a rotation with OpenCV's."""
    turn = np.array(rotation, np.float64) @ scene_cameras.OPENGL_FROM_OPENCV
    return np.concatenate([turn, np.array(place, np.float64).reshape(3, 1)], axis=1)


def pose_from(rotation, shift):
    """The same of a rotation and a translation from the world to the camera."""
    turn = np.array(rotation, np.float64).T
    return pose(turn, -turn @ np.array(shift, np.float64))


def rows(where, key, content, kind):
    """The rows [3, 4] of a pose under a key; ValueError naming `where` and the key."""
    json_files.check(content, {key: kind}, where)
    matrix = np.array(content[key], np.float64)
    if (np.abs(matrix[3:] - [0, 0, 0, 1]) > 1e-6).any():
        raise ValueError(f"{where}: {key}: its last row is not 0 0 0 1")
    return matrix[:3]


def smaller_of(folder):
    """The folders images_<n> in a folder, the largest photos first."""
    found = [path for path in folder.glob("images_*") if SMALLER.fullmatch(path.name)]
    return sorted(found, key=lambda path: int(path.name[7:]))


def numbers(where, words, count):
    """[count] float64 of words of a text; ValueError naming `where`."""
    try:
        values = np.array(words, np.float64)
    except ValueError:
        values = np.zeros(0)
    if len(values) != count or not (np.abs(values) < json_files.LARGEST).all():
        told = faults.shown(" ".join(words))
        raise ValueError(f"{where}: {count} numbers were expected, not {told}")
    return values


def rotation_of(quaternion):
    """Rotation [3, 3] of (x, y, z, w), times its length."""
    # NumPy's norm squares, which the largest numbers are too large for.
    length = math.hypot(*quaternion)
    x, y, z, w = quaternion / (length or 1)
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return length * (np.eye(3) + 2 * (w * across + across @ across))


def check_apart(shots, where):
    """ValueError where a phone has not tracked itself: all poses are one."""
    poses = [shot.pose for shot in shots]
    if len(poses) > 1 and all(
        np.array_equal(a, b) for a, b in itertools.pairwise(poses)
    ):
        raise ValueError(
            f"{where}: all {len(poses)} poses are the same: the phone did not track "
            "itself, as with the front camera"
        )
