"""Scenes with known cameras: the json of instant-ngp and nerfstudio.

Handled: intrinsics for all frames or frame by frame, `camera_angle_x` where no focal
length is given, the distortion of COLMAP's camera models by their parameters' names
(undone), frames without a pose (dropped with a warning), photos made smaller in
images_<n>, nerfstudio's own split (`train_filenames`, `test_filenames`; what is
validated is held out, too; frames in none of these are dropped). Refused by name: other
camera models. Poses are camera-to-world with OpenGL axes already; nerfstudio's
`applied_transform` is in them.
"""

import logging
import math
from pathlib import Path

import numpy as np

from alignerf.io import faults, json_files
from alignerf.io.json_files import NUMBER, OrNone
from alignerf.readers import shots
from alignerf.scenes import cameras, distortion, photo_names

log = logging.getLogger("alignerf")

NAME = "transforms.json"
# Keys of the distortion; those that a camera model lacks have to be 0.
DISTORTION_KEYS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
# COLMAP's models of all their numbers; others have their own names there.
PERSPECTIVE = ("OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "PERSPECTIVE", "RADIAL")
CAMERA_MODELS = {
    **dict.fromkeys((*PERSPECTIVE, "SIMPLE_RADIAL"), "FULL_OPENCV"),
    **dict.fromkeys(
        ("FISHEYE", "RADIAL_FISHEYE", "SIMPLE_RADIAL_FISHEYE"), "OPENCV_FISHEYE"
    ),
    "SPHERICAL": "EQUIRECTANGULAR",
}
LENS = ("w", "h", "fl_x", "fl_y", "cx", "cy", "camera_angle_x", "camera_angle_y")
MATRIX = json_files.matrix(4, 3, 4)
SHARED = dict.fromkeys((*LENS, *DISTORTION_KEYS), OrNone(NUMBER))
SHARED |= {"camera_model": OrNone(str), "is_fisheye": OrNone(bool)}
FRAME = SHARED | {"file_path": str, "mask_path": OrNone(str)}
FILE = SHARED | {
    "frames": [FRAME],
    **dict.fromkeys(("train_filenames", "test_filenames"), OrNone([str])),
    "val_filenames": OrNone([str]),
    "applied_transform": OrNone(MATRIX),
    "ply_file_path": OrNone(str),
}


def read(path, background=None, *, images=None, masks=None, choose=None):
    """(prepare.PosedViews, names of photos without a camera) of a json or its folder.

    background: as of `photos.decode`. images, choose: as of `placed`. masks: a folder
    of them, for a file that names none.
    """
    own = cameras_of(path)
    own = placed(own, own.where.parent, images, choose)
    return shots.views_of(own, background=background, masks=masks), own.left_out


def placed(own, folder, images=None, choose=None) -> shots.Cameras:
    """The `Cameras` with photos and masks; those of a split alone, where there are two.

    images: the n of the folder images_<n> that photos are read from; None for those
    that the file names or, where none of these is there, the images_<n> of least n.
    choose: as of `shots.placed`.
    """
    if images not in (None, 1):
        roots = [folder / f"images_{images}"]
    else:
        roots = [folder, *shots.smaller_of(folder)[: 1 if images is None else 0]]
    own = shots.placed(own, roots, choose=choose, is_told=True)
    own = own._replace(shots=with_masks(own, folder))
    kept, others = [], []
    for shot in own.shots:
        (kept if shot.split else others).append(shot)
    if len({shot.split for shot in kept}) < 2:
        if kept:
            log.warning("%s: its lists do not say what is held out", own.where)
        return own._replace(shots=[s._replace(split=None) for s in own.shots])
    if names := [shot.name for shot in others]:
        few = faults.some_names(names)
        log.warning("%s: neither trained on nor scored: %s", own.where, few)
    return own._replace(shots=kept, left_out=sorted([*own.left_out, *names]))


def cameras_of(path, *, split=None) -> shots.Cameras:
    """The cameras of a json, or of a folder's transforms.json.

    split: of all frames; None: as the file's own lists say. Raises ValueError with one
    line that names the file and the key or frame.
    """
    path = Path(path)
    path = path / NAME if path.is_dir() else path
    scene = json_files.read(path, FILE)
    splits = {} if split else splits_of(path, scene)
    found, lost = [], []
    for frame in scene["frames"]:
        name = frame["file_path"]
        of_frame = split or splits.get(name)
        if is_lost(frame):
            if of_frame == "test":
                raise ValueError(f"{path}: {told(frame)} is to be scored, without pose")
            lost.append(name)
            continue
        where = f"{path}: {told(frame)}"
        values = {k: v for k, v in (scene | frame).items() if v is not None}
        size = tuple(float(values[k]) for k in "wh" if k in values)
        if len(size) == 1:
            raise ValueError(f"{where}: one of 'w' and 'h' alone is no size")
        if size and min(size) <= 0:
            raise ValueError(f"{where}: 'w' and 'h' must be positive")
        found.append(
            shots.Shot(
                name,
                lens_of(where, values),
                shots.rows(where, "transform_matrix", frame, MATRIX),
                size or None,
                is_own={"fl_x", "cx"} <= frame.keys(),
                mask=frame.get("mask_path"),
                split=of_frame,
            )
        )
    if lost:
        log.warning(
            "%s: dropped %d of %d frames, which have no pose, or numbers that are "
            "none: %s",
            *(path, len(lost), len(scene["frames"]), faults.some_names(lost)),
        )
    applied = scene.get("applied_transform")
    if applied is not None:
        applied = np.vstack([applied[:3], [0, 0, 0, 1]])
        applied = applied if abs(np.linalg.det(applied)) > 1e-12 else None
    more = {"ply": scene.get("ply_file_path"), "applied": applied, "left_out": lost}
    return shots.cameras(path, found, NAME, **more)


def splits_of(path, scene):
    """{frame's file_path: its split} as nerfstudio's lists have it.

    Raises ValueError for a name that is to be scored and is no frame, or trained on.
    """
    names, found = [frame["file_path"] for frame in scene["frames"]], {}
    for split in ("train", "test", "val"):
        if not (listed := scene.get(f"{split}_filenames")):
            continue
        of_frames = photo_names.match(listed, names)
        if missing := [name for name in listed if name not in of_frames]:
            few = f"'{split}_filenames': no frame shows {faults.some_names(missing)}"
            if split == "test":
                raise ValueError(f"{path}: {few}")
            log.warning("%s: %s", path, few)
        for name in of_frames.values():
            other = found.setdefault(name, "train" if split == "train" else "test")
            if other == "train" and split == "test":
                named = faults.name_of(name)
                raise ValueError(f"{path}: {named} is to be trained on and scored")
    return found


def is_lost(frame):
    """Whether a pose is null or has a number that is none, as of lost tracking."""
    rows = frame.get("transform_matrix")
    of_rows = rows if isinstance(rows, list) else []
    entries = [e for row in of_rows if isinstance(row, list) for e in row]
    return rows is None or any(
        isinstance(entry, float) and not math.isfinite(entry) for entry in entries
    )


def told(frame):
    """A frame's file as it is named in messages."""
    return faults.name_of(frame["file_path"], 100)


def with_masks(own, folder):
    """The shots with their masks: where the file says, else in folders of masks."""
    names = [shot.mask for shot in own.shots if shot.mask]
    found = {name: mask for name in names if (mask := shots.at(folder, name))}
    if len(found) < len({*names}):
        there = [
            f"{place.name}/{path}"
            for place in sorted(folder.glob("*mask*"))
            for path in (photo_names.listed(place) if place.is_dir() else ())
        ]
        others = shots.named(names, folder, there)
        found = others | found
    if gone := [name for name in names if name not in found]:
        raise ValueError(f"{own.where}: no mask {faults.some_names(gone)}")
    bare = [shot.name for shot in own.shots if not shot.mask]
    if bare and names:
        few = faults.some_names(bare)
        log.warning("%s: no mask of %s: all of it is learned from", own.where, few)
    return [shot._replace(mask=found.get(shot.mask)) for shot in own.shots]


def lens_of(where, values):
    """`Shot.lens` of a frame's values."""
    model = "OPENCV_FISHEYE" if values.get("is_fisheye") else None
    model = (model or values.get("camera_model", "OPENCV")).upper()
    colmaps = CAMERA_MODELS.get(model, model)
    try:
        names = distortion.parameters(colmaps)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    json_files.check(values, dict.fromkeys(names, OrNone(NUMBER)), where)
    given, known = {key for key in DISTORTION_KEYS if values.get(key)}, {*names}
    # Beside k5, k4 is OpenCV's; else it may be nerfstudio's, of the 8th power.
    if colmaps == "FULL_OPENCV" != model and not given & {"k5", "k6"}:
        known.discard("k4")
    if others := sorted(given - known):
        raise ValueError(f"{where}: distortion {others[0]!r} is not supported")

    def lens(size):
        fx, fy = (
            focal_px(where, values, *axis) for axis in zip("xy", size, strict=True)
        )
        if fx is None:
            raise ValueError(f"{where} has neither 'fl_x' nor 'camera_angle_x'")
        own = {"cx": size[0] / 2, "cy": size[1] / 2} | values
        own |= {"f": fx, "fx": fx, "fy": fx if fy is None else fy}
        return shots.lens(where, colmaps, [own.get(name, 0.0) for name in names])

    return lens


def focal_px(where, values, axis, size):
    """Focal length in px, from itself or from the field of view; None for neither.

    size: of the photo along this axis. Raises ValueError for one that no lens has.
    """
    key, angle_key = f"fl_{axis}", f"camera_angle_{axis}"
    focal = values.get(key)
    if focal is None:
        key, angle = angle_key, values.get(angle_key)
        if angle is None:
            return None
        # Of the least numbers that there are, halves are 0.
        tangent = math.tan(0.5 * angle) if 0 < angle < math.pi else 0.0
        focal = 0.5 * size / tangent if tangent > 0 else 0.0
    least, most = cameras.FIELD
    if not size / most < focal < size / least:
        raise ValueError(f"{where}: no lens has its {key!r}, {values[key]:g}")
    return focal
