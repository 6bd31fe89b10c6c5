"""Scenes with known cameras: the json of instant-ngp and nerfstudio.

Handled: intrinsics for all frames or frame by frame, `camera_angle_x` where no focal
length is given, the distortion of COLMAP's camera models by their parameters' names
(undone), numbers of a photo 2, 4 or 8 times as large where the file does not say of
what size, photos of several sizes, photos in another place or of another suffix
(`photo_names`), frames without an image or a pose (dropped with a warning), photos made
smaller in images_<n>, nerfstudio's own split (`train_filenames` and `test_filenames`;
frames in neither are dropped, too). Refused by name: other camera models. No photo
outside of the scene's folder is read. Poses are camera-to-world with OpenGL axes
already; nerfstudio's `applied_transform` is in them. The points of its `ply_file_path`
are not read: found anew, points say how right the poses are.
"""

import functools
import logging
import math
import os
import re
import sys
from pathlib import Path

import numpy as np

from alignerf.io import faults, json_files
from alignerf.scenes import cameras, distortion, photo_names, photos, prepare
from alignerf.scenes.formats import shots

log = logging.getLogger(__name__)

# Keys of the distortion; those that a camera model lacks have to be 0.
DISTORTION_KEYS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
LENS_KEYS = ("camera_model", "is_fisheye", "w", "h", "fl_x", "fl_y", "cx", "cy")
LENS_KEYS += ("camera_angle_x", "camera_angle_y", *DISTORTION_KEYS)
# COLMAP's models of all their numbers; others have their own names there.
PERSPECTIVE = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "RADIAL")
CAMERA_MODELS = {
    **dict.fromkeys((*PERSPECTIVE, "SIMPLE_RADIAL"), "FULL_OPENCV"),
    **dict.fromkeys(
        ("FISHEYE", "RADIAL_FISHEYE", "SIMPLE_RADIAL_FISHEYE"), "OPENCV_FISHEYE"
    ),
    "SPHERICAL": "EQUIRECTANGULAR",
}
# Whether names that differ in case alone are those of two files.
TELLS_APART = sys.platform == "linux"
# instant-ngp's synthetic scenes leave the suffix away.
SUFFIXES = ("", ".png", ".jpg", ".jpeg", ".PNG", ".JPG", ".JPEG")
SMALLER = re.compile(r"images_([1-9][0-9]?)")
# Of any number in the file.
LARGEST = 1e30


def read(
    path, background=None, *, images=None, split_by_lists=True, masks=None, choose=None
):
    """Posed, undistorted views of a json file, or of a folder's transforms.json.

    background: as of `photos.decode`. images: the n of the folders <name>_<n> that
    photos and masks are read from; None for those that the file names or, where none of
    these photos is there, for images_<n> of least n. split_by_lists: the file's own
    lists say which views are held out. masks: a folder of them, for a file that names
    none. choose: `sfm.pairing.choose`, for photos that do not lie where the file says;
    None for its lens. Returns prepare.PosedViews and the names of the frames without an
    image. Raises ValueError with one line that names the file and the key or frame.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "transforms.json"
    scene = json_files.read(path, {"frames": list})
    if not (frames := scene["frames"]):
        raise ValueError(f"{path}: 'frames' must be a list that is not empty")
    kept, left_out, files = _frames_with_image(Images(path, images), frames)
    inside = {image: os.path.relpath(image, path.parent) for image in kept}
    names = photo_names.view_names(inside.values())
    name_of = {image: names[inside[image]] for image in kept}
    splits = _splits(files, scene, kept) if split_by_lists else {}
    if splits:
        left_out = sorted([*left_out, *(name_of[i] for i in kept if i not in splits)])
        kept = {image: frame for image, frame in kept.items() if image in splits}
    names = [name_of[image] for image in kept]
    if len(set(names)) < len(names):
        name = max(names, key=names.count)
        raise ValueError(f"{path}: two frames have the view name {faults.shown(name)}")
    mask_of = _masks(files, kept)
    sizes = {image: photos.head(image).size for image in kept}
    usual = prepare.usual_size(list(sizes.values()))
    own = [
        shots.Shot(
            name_of[image],
            image,
            *_lens_of(
                files, scene | frame, size_for(sizes[image], frame, usual), told(frame)
            ),
            mask=mask_of.get(image),
        )
        for image, frame in kept.items()
    ]
    if choose and any(files.find(f["file_path"]) != one for one, f in kept.items()):
        own = with_lens_of(path, own, choose)
    views = shots.views_of(
        own,
        path,
        background=background,
        masks=None if mask_of else masks,
        root=path.parent,
    )
    if splits:
        of_view = {name_of[image]: split for image, split in splits.items()}
        views = views._replace(split=np.array([of_view[name] for name in views.names]))
    return views, left_out


def with_lens_of(path, own, choose):
    """The shots with the lens that fits their photos; choose: as of `read`."""
    poses = np.stack([shot.camtoworld for shot in own])
    poses = cameras.nearest_rotations(path, [shot.name for shot in own], poses)
    lenses = {
        shot.name: (shot.camtopix, shot.size, pose, shot.distortion)
        for shot, pose in zip(own, poses, strict=True)
    }
    _, lenses = choose(path, lenses, [{shot.name: shot.photo for shot in own}])
    fields = ("camtopix", "size", "camtoworld", "distortion")
    return [
        shot._replace(**dict(zip(fields, lenses[shot.name], strict=True)))
        for shot in own
    ]


def size_for(own, frame, usual):
    """The (width, height) that a frame's numbers are of, where no w and h say it.

    That of most photos, but its own of one of another shape with numbers of its own.
    """
    alike = any(prepare.has_shape(one, usual) for one in (own, own[::-1]))
    return own if not alike and {"fl_x", "cx"} <= frame.keys() else usual


def _lens_of(files, values, size, where):
    """The fields of a Shot from a frame's values, of the size that they are of.

    size: (width, height) that they are of where they do not say.
    """
    size = [files.times_smaller * side for side in size]
    if not {"w", "h"} & values.keys():
        centre = [values.get("cx"), values.get("cy")]
        times = shots.times_of(centre, size) if all(map(shots.is_number, centre)) else 1
        size = [times * side for side in size]
    values = dict(zip("wh", size, strict=True)) | values
    size = tuple(number(files.path, values, key, where=where) for key in "wh")
    camtopix, coefficients = lens(files.path, values, where=where)
    return camtopix, size, pose(files.path, values), coefficients


def _masks(files, kept):
    """{image: its mask} of the frames that name one."""
    names = {image: mask_name(files, frame) for image, frame in kept.items()}
    of_name = files.find_masks([name for name in names.values() if name is not None])
    found = {image: of_name.get(name) for image, name in names.items()}
    for image, name in names.items():
        if name is not None and found[image] is None:
            named = f"mask {faults.shown(name)} of {told(kept[image])}"
            raise ValueError(f"{files.path}: no {named}")
    bare = [image.name for image, mask in found.items() if mask is None]
    if bare and len(bare) < len(found):
        few = faults.some_names(bare)
        log.warning("%s: no mask of %s: all of it is learnt from", files.path, few)
    return {image: mask for image, mask in found.items() if mask}


def _splits(files, scene, kept):
    """{image: its split} as nerfstudio writes it; none where it does not say.

    Raises ValueError for a name that is to be scored and has no frame with an image.
    """
    path, split_of = files.path, {}
    image_of = {frame["file_path"]: image for image, frame in kept.items()}
    for split in ("train", "test"):
        names = listed(path, scene, split)
        found = photo_names.match(names, list(image_of))
        if missing := [name for name in names if name not in found]:
            few = faults.some_names(missing)
            if split == "test":
                raise ValueError(f"{path}: 'test_filenames': no frame shows {few}")
            log.warning("%s: 'train_filenames': no frame shows %s", path, few)
        for image in {image_of[own] for own in found.values()}:
            if split_of.setdefault(image, split) != split:
                named = faults.name_of(image.name)
                raise ValueError(f"{path}: {named} is to be trained on and scored")
    if len(set(split_of.values())) < 2:
        if split_of:
            log.warning("%s: its lists do not say what is held out", path)
        return {}
    if others := [image.name for image in kept if image not in split_of]:
        few = faults.some_names(others)
        log.warning("%s: neither trained on nor scored: %s", path, few)
    return split_of


def listed(path, scene, split):
    """The paths of one of nerfstudio's lists; ValueError where it is none."""
    names = scene.get(f"{split}_filenames", [])
    if not isinstance(names, list) or not all(isinstance(n, str) for n in names):
        raise ValueError(f"{path}: '{split}_filenames' must be a list of paths")
    return names


def _frames_with_image(files, frames):
    """{image: its frame}, the names of frames without one, and where photos are.

    files: an `Images`; another one comes back where only smaller photos are there.
    """
    path, kept, twice = files.path, {}, []
    for i, frame in enumerate(frames):
        if not isinstance(frame, dict) or not isinstance(frame.get("file_path"), str):
            raise ValueError(f"{path}: frame {i} has no text under 'file_path'")
    found = files.find_all([frame["file_path"] for frame in frames])
    for frame in frames:
        image = found.get(frame["file_path"])
        if image in kept and not is_lost(frame):
            check_same(path, kept[image], frame)
            twice.append(told(frame))
        elif image is not None and not is_lost(frame):
            kept[image] = frame
    missing = [f["file_path"] for f in frames if f["file_path"] not in found]
    if not found:
        number = min_number(path.parent)
        if files.suffix or number in (None, 1):
            where = f"folders {files.suffix} of " if files.suffix else ""
            none = f"none of its {len(frames)} frames has an image in {where}"
            none += f"{files.folder}: {faults.some_names(missing)}"
            if place := files.elsewhere(missing):
                none += f". Photos so called lie in {place}: move or link it into that"
            raise ValueError(f"{path}: {none}")
        log.info("%s: photos from images_%d", path, number)
        return _frames_with_image(Images(path, number), frames)
    images = ((frame, found.get(frame["file_path"])) for frame in frames)
    lost = [told(frame) for frame, one in images if one and one not in kept]
    for names, why in (
        (missing, "have no image"),
        (twice, "are there twice: the first is taken"),
        (lost, "have no pose, or numbers that are none"),
    ):
        if names:
            few = faults.some_names(names)
            count = len(names), len(frames)
            log.warning(
                "%s: dropped %d of %d frames, which %s: %s", path, *count, why, few
            )
    if not kept:
        raise ValueError(f"{path}: none of its {len(frames)} frames has a pose")
    return kept, sorted(Path(name).stem for name in [*missing, *lost]), files


def check_same(path, first, frame):
    """ValueError naming two frames of one photo whose cameras differ."""
    keys = ("transform_matrix", *LENS_KEYS)
    if any(first.get(key) != frame.get(key) for key in keys):
        both = f"{told(first)} and {told(frame)}"
        raise ValueError(f"{path}: two frames of one photo differ in pose: {both}")


def is_lost(frame):
    """Whether a pose is null or has a number that is none, as of lost tracking."""
    rows = frame.get("transform_matrix")
    if rows is None:
        return True
    entries = (
        [e for row in rows if isinstance(row, list) for e in row]
        if isinstance(rows, list)
        else []
    )
    return any(
        isinstance(entry, float) and not math.isfinite(entry) for entry in entries
    )


def mask_name(files, frame):
    """The path under nerfstudio's key, None where there is none; else ValueError."""
    name = frame.get("mask_path")
    if not (name is None or isinstance(name, str)):
        named = f"mask {faults.shown(name)} of {told(frame)}"
        raise ValueError(f"{files.path}: no {named}")
    return name


def lens(path, values, *, where):
    """(camtopix [3, 3], distortion as in `distortion`) of a photo of their w and h."""
    model = values.get("camera_model", "OPENCV")
    is_fisheye = values.get("is_fisheye", False)
    if not isinstance(is_fisheye, bool):
        value = faults.shown(is_fisheye)
        raise ValueError(
            f"{path}: 'is_fisheye' of {where} is neither true nor false: {value}"
        )
    if is_fisheye:
        model = "OPENCV_FISHEYE"
    if not isinstance(model, str):
        raise ValueError(
            f"{path}: camera model of {where} is no text: {faults.shown(model)}"
        )

    def of_key(key, default=None):
        return number(path, values, key, default, where=where)

    given = {key for key in DISTORTION_KEYS if of_key(key, 0.0)}
    model = model.upper()
    colmaps = CAMERA_MODELS.get(model, model)
    try:
        keys = distortion.parameters(colmaps)[4:]
    except ValueError as error:
        raise ValueError(f"{path}: {where}: {error}") from None
    # Beside k5, k4 is OpenCV's; else it may be nerfstudio's, of the 8th power.
    if colmaps != model and not given & {"k5", "k6"}:
        keys = [key for key in keys if colmaps != "FULL_OPENCV" or key != "k4"]
    if others := sorted(given - {*keys}):
        raise ValueError(
            f"{path}: distortion {others[0]!r} of {where} is not supported"
        )
    given_width, given_height = of_key("w"), of_key("h")
    if min(given_width, given_height) <= 0:
        raise ValueError(f"{path}: 'w' and 'h' of {where} must be positive")
    fl_x = _focal(of_key, "x", given_width, where=f"{path}: {where}")
    fl_y = _focal(of_key, "y", given_height, where=f"{path}: {where}")
    if fl_x is None:
        raise ValueError(f"{path}: {where} has neither 'fl_x' nor 'camera_angle_x'")
    fl_y = fl_x if fl_y is None else fl_y
    cx, cy = of_key("cx", given_width / 2), of_key("cy", given_height / 2)
    camtopix = np.array([[fl_x, 0, cx], [0, fl_y, cy], [0, 0, 1]])
    coefficients = distortion.of_model(colmaps, {key: of_key(key, 0.0) for key in keys})
    return camtopix, coefficients


def _focal(number, axis, size, *, where):
    """Focal length in px, from itself or from the field of view; None for neither.

    number: of a key; size: of the photo along this axis. Raises ValueError for one that
    no lens has.
    """
    key, angle_key = f"fl_{axis}", f"camera_angle_{axis}"
    focal = number(key)
    if focal is None:
        key, angle = angle_key, number(angle_key)
        if angle is None:
            return None
        # Of the least numbers that there are, halves are 0.
        tangent = math.tan(0.5 * angle) if 0 < angle < math.pi else 0.0
        focal = 0.5 * size / tangent if tangent > 0 else 0.0
    least, most = cameras.FIELD
    if not size / most < focal < size / least:
        raise ValueError(f"{where}: no lens has its {key!r}, {number(key):g}")
    return focal


def number(path, values, key, default=None, *, where):
    value = values.get(key, default)
    if value is None and key not in values:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float):
        value = faults.shown(value)
        raise ValueError(f"{path}: {key!r} of {where} must be a number, not {value}")
    # A whole number of 400 digits has no floating one.
    if not abs(value) < LARGEST:
        raise ValueError(f"{path}: {key!r} of {where} is {faults.shown(value)}")
    return float(value)


def told(frame):
    """A frame's file as it is named in messages."""
    return faults.name_of(frame["file_path"], 100)


def pose(path, frame):
    """The frame's camera-to-world [3, 4]; its rotation may be scaled."""
    where = f"{path}: 'transform_matrix' of {told(frame)}"
    matrix = prepare.matrix_of(frame.get("transform_matrix"), (3, 4), (4, 4))
    if matrix is None:
        raise ValueError(f"{where} is not 4x4 numbers")
    if len(matrix) == 4 and not np.allclose(matrix[3], [0, 0, 0, 1]):
        raise ValueError(f"{where}: its last row is not 0 0 0 1")
    return matrix[:3]


def min_number(folder):
    """The least n of the folders images_<n>, the largest photos; None without any."""
    found = [SMALLER.fullmatch(path.name) for path in Path(folder).glob("images_*")]
    return min((int(one[1]) for one in found if one), default=None)


class Images:
    """The files beside a json, each folder listed once: there may be 100,000 frames.

    number: photos are those of <folder>_<number>, as `images_4` beside `images`, where
    nerfstudio has made them smaller; None for the folders that the json names.
    """

    def __init__(self, path, number=None):
        self.path, self.folder = path, os.path.abspath(path.parent)
        self.times_smaller = number or 1
        self.suffix = "" if self.times_smaller == 1 else f"_{number}"
        self.listed = functools.cache(self.names_in)

    def find_all(self, names):
        """{name: path of its image}: where it says, else by `photo_names.match`."""
        found = {name: image for name in names if (image := self.find(name))}
        if self.suffix or len(found) == len({*names}):
            return found
        folder, taken = Path(self.folder), {*found.values()}
        others = photo_names.match(names, photo_names.listed(folder), self.path)
        others = {name: folder / path for name, path in others.items()}
        return {n: path for n, path in others.items() if path not in taken} | found

    def find_masks(self, names):
        """{name: path of its mask} likewise, else in the folders of masks alone."""
        found = {name: mask for name in names if (mask := self.find(name))}
        if len(found) == len({*names}):
            return found
        folder, there = Path(self.folder), []
        for place in sorted(folder.glob("*mask*")):
            of_place = photo_names.listed(place) if place.is_dir() else ()
            there += [f"{place.name}/{path}" for path in of_place]
        others = photo_names.match(names, there, self.path)
        return {name: folder / path for name, path in others.items()} | found

    def find(self, file_path):
        """The image at the place that a path says, or None; none outside."""
        # By name, not resolved: a link inside the folder is the user's own decision.
        plain = file_path.replace("\\", "/")
        place = os.path.normpath(os.path.join(self.folder, plain))
        if not place.startswith(self.folder.rstrip(os.sep) + os.sep):
            return None
        own, name = os.path.split(place)
        for folder in self.smaller(own):
            for suffix in SUFFIXES:
                # Where case or accents do not tell names apart, the disk is asked.
                if not TELLS_APART or name + suffix in self.listed(folder):
                    image = Path(folder, name + suffix)
                    if image.is_file():
                        return image
        return None

    def smaller(self, folder):
        """Where a folder's photos are: images_4/left or images/left_4 for images/left.

        The folder itself where they are as the json names them.
        """
        parts = Path(os.path.relpath(folder, self.folder)).parts
        if not self.suffix or not parts:
            return [folder]
        return [
            os.path.join(self.folder, *parts[:i], part + self.suffix, *parts[i + 1 :])
            for i, part in enumerate(parts)
        ]

    def elsewhere(self, names):
        """The folder beside this one, or named by a path, that has images so called."""
        above = os.path.dirname(self.folder)
        beside = [os.path.join(above, name) for name in sorted(self.listed(above))]
        named = [os.path.dirname(os.path.join(self.folder, name)) for name in names]
        for place in map(os.path.normpath, dict.fromkeys([*named, *beside])):
            is_outside = os.path.relpath(place, self.folder).startswith(os.pardir)
            if is_outside and photo_names.match(names, self.listed(place)):
                return place
        return None

    @staticmethod
    def names_in(folder):
        """Names of all that lies in a folder; none where there is no such folder."""
        try:
            return frozenset(os.listdir(folder))
        # A name may be too long, or hold a zero, for any file.
        except (OSError, ValueError):
            return frozenset()
