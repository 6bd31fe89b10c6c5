"""Renders of a splat's own file, at the cameras of the photos.

A trainer may have turned, moved or scaled its world, and its .ply does not say so. The
worlds that it may have are tried: the photos tell which it is. They tell, too, what a
.ply does not say of its rendering: the near plane and the anti-aliasing.

Notation: a world is a similarity [4, 4], from the cameras' world to the splat's; poses
are camera-to-world [3, 4], OpenGL axes.
"""

import contextlib
import itertools
import json
import logging
import math
import os
import re
from pathlib import Path

import cv2
import numpy as np

from alignerf.io import (
    atomic,
    faults,
    images,
    json_files,
    owned,
    progress,
    provenance,
)
from alignerf.judged import camera_files, gsplat, likeness, originals
from alignerf.readers import shots
from alignerf.readers.programs import reading
from alignerf.scenes import cameras as scene_cameras
from alignerf.scenes import distortion, photo_names, photos, prepare
from alignerf.splats import ply, rasterize

log = logging.getLogger("alignerf")

# Renders are at most so wide or high, as trainers make larger photos smaller.
LONGEST_PX = 1600
# The views by which worlds are compared, and by which photos are.
VIEWS, LOOKED_AT = 4, 12
# What a .ply may leave open: 3DGS renders what is 0.2 away and more, others from 0.01
# on. A better fit to the photos by so many dB decides against the first.
NEARS, CLEARLY_DB = ((rasterize.NEAR, rasterize.MAX_ALPHA), (0.01, 0.999)), 0.02
# Written by nerfstudio beside its checkpoints.
NERFSTUDIO, ABOVE = "dataparser_transforms.json", 4
# Of gsplat above its .ply: the divisor of the photos.
GSPLAT, DIVIDED_BY = "cfg.yml", r"^data_factor: ([1-9]\d{0,2})$"
# Of 3DGS beside its model: what was asked, a divisor of the photos or their width.
OPTIONS, DIVIDES = "cfg_args", (1, 2, 4, 8)
NOTED = [r"\bresolution=(-?\d+)", r"\bimages=.images_([248])\b"]
# What is told of them, beside the renders.
TOLD = "splat.json"
# Fewer cameras do not fix a similarity.
MIN_CAMERAS = 3
AS_TRAINED = "give photos, cameras and splat as they were in its training"
WHERE_NONE_FITS = (
    f"give the cameras of its own training (gsplat: sparse/0), or copy beside it what "
    f"its trainer wrote: {camera_files.GAUSSIANS} (OpenSplat, 3DGS), {NERFSTUDIO} "
    "(nerfstudio). If it was moved in an editor, give RENDERS, or train gsplat with "
    "--no-normalize-world-space"
)
OPENCV = np.diag([1.0, -1.0, -1.0])


def render(path, cameras: shots.Cameras, folder, files=(), background=None, size=None):
    """Write renders and depth of all photos of cameras; returns what is told of it.

    files: all that these renders are made from, for `is_of`.
    folder: gets rgb/<view>.png and depth/<view>.npy, in the unit of the cameras.
    background: as of `photos.decode`; renders without one are before black.
    size: the longest side of the photos that it was trained on, where that is known.
    Raises ValueError in one line for a file that is no splat, or one that does not show
    the photos from these cameras.
    """
    gaussians = ply.read(path)
    views = sorted(cameras.shots, key=lambda shot: shot.name)
    seen = of_one_shape([View(shot, background) for shot in views])
    few = some(seen, VIEWS)
    name, world, shows = world_of(path, gaussians, few, cameras)
    check_shown(path, gaussians, seen, world, shows)
    known_px = size or trained_px(path, cameras)
    longest_px = size or min(LONGEST_PX, known_px or LONGEST_PX)
    options = options_of(gaussians, few, world, longest_px)
    shape = few[0].size(longest_px)
    log.info("%s: %d Gaussians, %dx%d px", path, len(gaussians.means), *shape)
    if not known_px:
        option = f"--size {max(shape) // 2}"
        log.warning(
            "no file says the size of the photos that it was trained on: if their "
            "longest side is not %d px, add it, as in %s",
            *(max(shape), provenance.typed(f'OPTIONS="{option}"', option)),
        )
    log.info("its world: %s (likeness to the photos %.2f)", name, shows)
    with atomic.replace_folder(folder) as fresh:
        for inner in ("rgb", "depth"):
            (fresh / inner).mkdir()
        for one in progress.over(seen, "renders of the splat", total=len(seen)):
            made = one.render(gaussians, world, longest_px, **options)
            image = likeness.to_bytes(made.colour)
            images.write(fresh / "rgb" / f"{one.name}.png", image)
            depth = np.where(made.alpha > 0.5, made.depth, np.inf) / scale_of(world)
            np.save(fresh / "depth" / f"{one.name}.npy", depth.astype(np.float32))
        told = {"gaussians": len(gaussians.means), "world": name, "likeness": shows}
        told |= {"background": background, "trained_px": known_px, "size": size}
        there = filter(os.path.isfile, files)
        told["files"] = {originals.named(p): originals.described(p) for p in there}
        (fresh / TOLD).write_text(json.dumps(told, indent=1) + "\n")
        owned.seal(fresh)
    return told


def some(seen, count):
    """Up to so many of the views, all along them."""
    places = np.linspace(0, len(seen) - 1, min(count, len(seen)))
    return [seen[round(place)] for place in places]


def is_of(folder, files, background=None, size=None):
    """Whether a folder's renders are of files as they are now, made as is asked."""
    try:
        whole = json_files.read(Path(folder, TOLD), {"files": dict})
    except (OSError, ValueError):
        return False
    told = whole["files"]
    names = {originals.named(path) for path in files if os.path.isfile(path)}
    return (
        names == told.keys()
        and (background, size) == (whole.get("background"), whole.get("size"))
        and all(isinstance(one, list) and len(one) == 3 for one in told.values())
        and not any(originals.is_other(path, before) for path, before in told.items())
    )


def of_one_shape(seen):
    """The views whose photos have the usual shape, all at the usual size."""
    sizes = [one.photo_size for one in seen]
    usual = prepare.usual_size(sizes)
    fits = [prepare.has_shape(size, usual) for size in sizes]
    if odd := [one.name for one, fit in zip(seen, fits, strict=True) if not fit]:
        log.warning("photos of another shape are left out: %s", faults.some_names(odd))
    for one in seen:
        one.usual = usual
    return [one for one, fit in zip(seen, fits, strict=True) if fit]


class View:
    """A photo and its lens, as a pinhole camera of the splat's world renders it."""

    def __init__(self, shot: shots.Shot, background=None):
        self.name, self.path, self.pose = shot.name, shot.photo, shot.pose
        self.background = background
        # Of a photo whose rows are stored on its side, cameras may be of the other.
        self.upright = min(shot.size) > 0 and shot.head.lies_as(shot.size)
        size = shot.head.size
        self.photo_size = size[::-1] if self.upright else size
        # Of the photo that most are like.
        self.usual = self.photo_size
        self.camtopix, self.distortion = shot.at(self.photo_size, self.path)

    def size(self, longest_px):
        """(width, height) of a render; never larger than the usual photo."""
        ratio = min(1.0, longest_px / max(self.usual))
        return tuple(max(round(side * ratio), 1) for side in self.usual)

    def render(self, gaussians, world, longest_px, **options) -> rasterize.Render:
        width, height = self.size(longest_px)
        across = np.array([width, height]) / self.photo_size
        fx, fy = self.camtopix[[0, 1], [0, 1]] * across
        cx, cy = self.camtopix[:2, 2] * across
        camera = rasterize.Camera(
            world_to_camera(self.pose, world), fx, fy, cx, cy, width, height
        )
        behind = photos.BACKGROUNDS.get(self.background, 0) / 255
        return rasterize.render(gaussians, camera, background=(behind,) * 3, **options)

    def photo(self, longest_px):
        """The photo as a pinhole camera of the same focal length takes it."""
        size = self.size(longest_px)
        image = photos.decode(
            self.path, self.background, upright=self.upright, least_px=min(size)
        )[0]
        image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
        across = np.diag([*np.array(size) / self.photo_size, 1.0])
        camtopix = across @ self.camtopix
        if distortion.is_pinhole(self.distortion):
            return image
        return distortion.undistort(image, camtopix, self.distortion, camtopix)


def world_to_camera(pose, world):
    """[3, 4] with OpenCV's axes, of a pose in the cameras' world."""
    turn = world[:3, :3] / scale_of(world) @ pose[:, :3] @ OPENCV
    place = world[:3, :3] @ pose[:, 3] + world[:3, 3]
    return np.concatenate([turn.T, -turn.T @ place[:, None]], axis=1)


def scale_of(world):
    return np.cbrt(abs(np.linalg.det(world[:3, :3])))


def world_of(path, gaussians, few, cameras):
    """(name, world, likeness) of the world in which a splat shows the photos best.

    Raises ValueError where it shows them mirrored.
    """
    known = dict(known_worlds(path, cameras))
    best = max(scored(gaussians, few, known.items()), key=lambda one: one[2])
    if best[2] < likeness.SURE:
        more = normalized_by_gsplat(cameras)
        known |= more
        found = [best, *scored(gaussians, few, more.items())]
        best = max(found, key=lambda one: one[2])
    if best[2] < likeness.SURE:
        flips = {
            f"{name}, mirrored in {axis}": np.diag([*1 - 2.0 * np.eye(3)[i], 1]) @ world
            for name, world in known.items()
            for i, axis in enumerate("xyz")
        }
        flipped = max(scored(gaussians, few, flips.items()), key=lambda one: one[2])
        if flipped[2] > max(best[2], likeness.SHOWS):
            raise ValueError(
                f"{path}: it or the photos are mirrored ({flipped[0]}): {AS_TRAINED}"
            )
    return best


def check_shown(path, gaussians, seen, world, shows):
    """ValueError where a splat does not show the photos of its cameras, or others."""
    size, found = likeness.SMALL_PX, {}
    small = {
        one.name: one.photo(size)
        for one in progress.over(seen, "photos", total=len(seen))
    }
    for one in some(seen, LOOKED_AT):
        made = one.render(gaussians, world, size)
        found[one.name] = likeness.instead(made, one.name, small)
    # Few that are swapped are left out by the verdict.
    if np.median([nearer for nearer, _ in found.values()]) > likeness.NEARER:
        view = max(found, key=found.get)
        raise ValueError(
            f"{path}: from the camera of {view} it shows {found[view][1]}: {AS_TRAINED}"
        )
    if shows < likeness.SHOWS:
        raise ValueError(
            f"{path}: from these cameras it does not show the photos (likeness "
            f"{shows:.2f}, {likeness.SHOWS} is asked): {WHERE_NONE_FITS}"
        )


def scored(gaussians, few, worlds):
    """(name, world, likeness of renders to photos) of each world."""
    small = [one.photo(likeness.SMALL_PX) for one in few]
    for name, world in worlds:
        made = [one.render(gaussians, world, likeness.SMALL_PX) for one in few]
        found = [likeness.of(m, [p])[0] for m, p in zip(made, small, strict=True)]
        yield name, world, float(np.mean(found))


def known_worlds(path, cameras):
    """(name, world) of those that a splat may have, by what lies beside its file."""
    applied = cameras.applied
    back = np.eye(4) if applied is None else np.linalg.inv(applied)
    yield "as the cameras'", np.eye(4)
    if applied is not None:
        yield "without the cameras' applied_transform", back
    if theirs := trained_by(path):
        world = similarity(cameras, theirs)
        if world is not None:
            yield f"by the {camera_files.GAUSSIANS} of its training", world
    for beside in above(path, NERFSTUDIO):
        kinds = {"transform": json_files.matrix(4, 3), "scale": json_files.NUMBER}
        told, world = json_files.read(beside, kinds), np.eye(4)
        world[:3] = told["scale"] * np.array(told["transform"])
        if not 1e-9 < scale_of(world) < 1e9:
            raise ValueError(f"{beside}: 'transform' and 'scale' are no similarity")
        yield f"by {beside.name}", world
        yield f"by {beside.name}, without applied_transform", world @ back
        return


def normalized_by_gsplat(cameras):
    """{name: world} of those that `simple_trainer` makes of a project."""
    # It takes all cameras, also of photos that are not given.
    every = camera_files.read(cameras.where) if cameras.left_out else cameras
    if every.points is None:
        return {}
    return gsplat.worlds([shot.pose for shot in every.shots], every.points[0])


def above(path, name):
    """The files of a name beside a path and in the folders above."""
    folders = itertools.islice(Path(path).absolute().parents, ABOVE)
    return filter(Path.is_file, (folder / name for folder in folders))


def trained_by(path):
    """The cameras that the trainer has written beside a splat, or None."""
    # Those of another scene are no reason to stop: they are not asked for.
    with contextlib.suppress(ValueError, StopIteration):
        return reading.cameras_of(next(above(path, camera_files.GAUSSIANS)))
    return None


def trained_px(path, cameras=None):
    """The longest side of the photos that a splat was trained on; None where unknown.

    Rendered larger, it has less detail than the photos, which is no misalignment. 3DGS
    writes the size of the photos, and beside it how much smaller it has made them,
    or taken them from images_4. gsplat writes how much smaller than those of
    its cameras alone.
    """
    for beside in above(path, GSPLAT) if cameras else ():
        if told := re.search(DIVIDED_BY, faults.text(beside), re.MULTILINE):
            return max(max(shot.size) for shot in cameras.shots) // int(told[1])
    if not (theirs := trained_by(path)):
        return None
    width_px = max(shot.size[0] for shot in theirs.shots)
    longest_px = max(max(shot.size) for shot in theirs.shots)
    for beside in above(path, OPTIONS):
        told, smaller = (re.search(one, faults.text(beside)) for one in NOTED)
        asked, times = int(told[1]) if told else -1, int(smaller[1]) if smaller else 1
        if asked not in DIVIDES:
            asked = max(1.0, width_px / times / (asked if asked > 0 else LONGEST_PX))
        return longest_px / times / asked
    return longest_px


def similarity(own, theirs):
    """The world [4, 4] in which cameras of the same photos are theirs; None of few.

    And of cameras that lie the other way around: no world makes them so.

    own: with photos; theirs: as their file calls them.
    """
    paths = {str(shot.photo.relative_to(own.root)): shot.pose for shot in own.shots}
    their = {shot.name: shot.pose for shot in theirs.shots}
    pairs = photo_names.match(their, list(paths))
    if len(pairs) < MIN_CAMERAS:
        return None
    poses = np.stack([paths[path] for path in pairs.values()])
    to = np.stack([their[name] for name in pairs])
    scale, turn, shift = scene_cameras.align_similarity(poses, to)
    if not scale > 0:
        return None
    world = np.eye(4)
    world[:3] = np.column_stack([scale * turn, shift])
    return world


def options_of(gaussians, few, world, longest_px):
    """Options of the rasteriser that a .ply leaves open, as fits the photos."""
    smooth = [gaussians.antialiased]
    if gaussians.antialiased is None:
        smooth = [False, True]
    tried = [
        {"near": near, "max_alpha": most, "antialiased": one}
        for one in smooth
        for near, most in NEARS
    ]
    pairs = [(one, one.photo(longest_px).astype(np.float64)) for one in few[:2]]

    def error_db(options):
        errors = []
        for view, photo in pairs:
            made = view.render(gaussians, world, longest_px, **options)
            errors.append(np.mean((likeness.to_bytes(made.colour) - photo) ** 2))
        return 10 * math.log10(max(np.mean(errors), 1e-9))

    errors = [error_db(one) for one in tried]
    best = int(np.argmin(errors))
    return tried[best if errors[best] < errors[0] - CLEARLY_DB else 0]
