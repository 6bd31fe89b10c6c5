"""A prepared scene folder, as every stage after the poses reads it.

`images/<view>.png`, and `cameras.npz` with pixtocams [n, 3, 3], camtoworlds
[n, 3, 4], names [n], width, height, split [n] ('train' or 'test').
"""

import dataclasses
import logging
import math
import pathlib
import re
import unicodedata
from types import SimpleNamespace

import numpy as np

from alignerf.io import archives, faults, images, json_files, machine
from alignerf.scenes import cameras

log = logging.getLogger(__name__)

SPLITS = ("train", "test")
NUMBER, OrNone = json_files.NUMBER, json_files.OrNone
# What adjusting says of cameras; of those that held-out matches have accepted, numbers.
ACCEPTED = {"accepted": bool} | dict.fromkeys(
    ("before_px", "after_px", "pose_error_px", "worst_px"), NUMBER
)
LEFT = {"accepted": OrNone(bool)}
LEFT |= dict.fromkeys(("before_px", "after_px"), OrNone(NUMBER))
# What some poses.json say, and what each says; its readers may ask for more.
CHECKED = {"adjustment": OrNone(lambda told: ACCEPTED if is_accepted(told) else LEFT)}
MORE = {
    **dict.fromkeys(("poses", "perturb_by", "source", "photos_alone"), OrNone(str)),
    **dict.fromkeys(("perturb_px", "photo_height", "downscale"), OrNone(NUMBER)),
    **dict.fromkeys(("again", "external_renders"), OrNone(dict)),
    # {view: how many, clockwise, make it stand upright}.
    "quarter_turns": OrNone({str: json_files.one_of(0, 1, 2, 3)}),
    "downscale_decided": OrNone(bool),
    "left_out": OrNone([str]),
    "photo_size": OrNone(json_files.list_of(2, json_files.positive)),
    "camera_check": OrNone(CHECKED),
}
POSES = MORE | dict.fromkeys(
    ("width", "photo_width", "registered", "total"), json_files.positive
)
POSES |= {"mean_reprojection_error_px": json_files.NUMBER_OR_NONE}
# Of a scene of crops, where each was cut.
CROP = {"points": [json_files.list_of(3, NUMBER)], "px": json_files.positive}
# What some scenes have besides lies among their images, which go wherever a stage is.
# Folder of <view>.npz {valid}, of scenes whose photos do not count everywhere.
MASKS = "images/masks"
# Below a scratch folder: files of a source that are to lie among the images.
BESIDE = "beside"
# COLMAP's points {points, colours}, and LLFF's depths {bounds} of each view.
POINTS, BOUNDS = "images/points.npz", "images/bounds.npz"
# The lens {names, camtopix, distortion, camera_of} of each photo, where COLMAP has it.
LENSES = "images/lenses.npz"
# The lens {camtopix, distortion} of undistorted photos, where adjusting has found more.
LENS = "images/lens.npz"
# Adjusted cameras beside the scene's own: cameras.npz of all views, train.npz with
# held-out views as they came.
ADJUSTED = "images/adjusted"
# What OpenCV can warp.
MAX_SIDE_PX = 32766
# Bytes of a view's name: with suffixes, and beside it what is being written, it has to
# be a file's.
MAX_NAME_BYTES = 180
# Control characters, halves of others, ends of lines and paragraphs.
NO_LETTERS = ("Cc", "Cs", "Zl", "Zp")
# Units within which cameras are at one place (`cameras.frame_of`).
ONE_PLACE = 1e-9
# Of the places: so many steps of their numbers, at least, is one from the others.
MIN_STEPS = 1000
# Times the median distance that a camera is away: one is warned of, and no more.
FAR, MAX_FAR = 1e3, 1e5
# JAX copies arrays that start elsewhere.
ALIGNMENT = 64
# How a cell begins that calls something; -1 and "+ 2" call nothing.
FORMULA = re.compile(r"=|[+@-].*[(|!]")


@dataclasses.dataclass(frozen=True)
class Scene:
    """Cameras in the normalised frame: centred, PCA-rotated, max |t| = 1."""

    folder: pathlib.Path
    names: list[str]
    split: np.ndarray
    pixtocams: np.ndarray
    camtoworlds: np.ndarray
    width: int
    height: int

    def views(self, split):
        """Indices of the views of a split, in name order; none is an error."""
        chosen = np.flatnonzero(self.split == split)
        if len(chosen) == 0:
            raise ValueError(f"{self.folder / 'cameras.npz'}: no {split} view")
        return chosen


def load(folder, cameras_path=None) -> Scene:
    """Read and check a scene's cameras; poses come out normalised.

    cameras_path: other cameras of the same views, in the given frame (see
    `alignerf.correct_poses`). They are normalised by the scene's own cameras, so models
    trained with either share one frame.
    """
    own = pathlib.Path(folder) / "cameras.npz"
    path = pathlib.Path(cameras_path or own)
    data = read_cameras(path)
    original = data if path == own else read_cameras(own)
    for key in ("names", "split", "width", "height"):
        if not np.array_equal(data[key], original[key]):
            raise ValueError(f"{path}: {key} differ from those of {own}")
    frame = cameras.frame_of(original["camtoworlds"])
    return Scene(
        folder=pathlib.Path(folder),
        names=data["names"].tolist(),
        split=data["split"],
        pixtocams=data["pixtocams"],
        camtoworlds=frame.normalised(data["camtoworlds"]),
        width=int(data["width"]),
        height=int(data["height"]),
    )


def write_cameras(path, scene: Scene, cameras_path=None, views=slice(None)):
    """Write a copy of a cameras.npz with the scene's lenses and poses of some views.

    cameras_path: the file that is copied, as in `load`. The poses of all other views
    are copied to the bit.
    """
    own = scene.folder / "cameras.npz"
    frame = cameras.frame_of(read_cameras(own)["camtoworlds"])
    arrays = read_cameras(cameras_path or own)
    arrays["pixtocams"] = scene.pixtocams
    arrays["camtoworlds"] = arrays["camtoworlds"].copy()
    arrays["camtoworlds"][views] = frame.given(scene.camtoworlds[views])
    with open(path, "wb") as file:
        np.savez(file, **arrays)


# NumPy's kinds of the arrays of a cameras.npz.
KINDS = {"names": "U", "split": "U", "width": "iu", "height": "iu"}
KINDS |= {"pixtocams": "f", "camtoworlds": "f"}


def read_cameras(path):
    """The arrays of a cameras.npz, checked; poses are in the given frame."""
    path = pathlib.Path(path)
    data = archives.read(
        path, ("pixtocams", "camtoworlds", "names", "width", "height", "split")
    )
    check_arrays(path, data)
    views = dict(data, names=data["names"].tolist())
    del views["split"]
    check_views(path, SimpleNamespace(**views))
    if bad := set(data["split"].tolist()) - set(SPLITS):
        raise ValueError(f"{path}: split holds {faults.shown(sorted(bad)[0])}")
    return data


def check_arrays(path, data):
    """ValueError, naming the path, for arrays of another shape or kind."""
    n = data["names"].shape[:1]
    shapes = {
        "names": n,
        "split": n,
        "pixtocams": (*n, 3, 3),
        "camtoworlds": (*n, 3, 4),
    }
    for key, kinds in KINDS.items():
        array, shape = data[key], shapes.get(key, ())
        if array.dtype.kind not in kinds or array.shape != shape:
            found = f"{array.dtype} {list(array.shape)}"
            raise ValueError(f"{path}: {key} is {found}, not of shape {list(shape)}")


def check_views(path, views):
    """ValueError, naming the path, for names that are no file's and for bad cameras.

    views: with names, pixtocams, camtoworlds, width and height.
    """
    if not len(views.names):
        raise ValueError(f"{path}: no view")
    size = int(views.width), int(views.height)
    if not all(0 < side <= MAX_SIDE_PX for side in size):
        raise ValueError(f"{path}: photos of {size[0]}x{size[1]} pixels")
    check_names(path, views.names)
    cameras.check(path, views.names, views.pixtocams, views.camtoworlds, size)


def check_places(where, views):
    """Whether the cameras' places are apart, once they are normalised in float32.

    views: with names and camtoworlds. Warns of a camera far from all others. Raises
    ValueError where so little is left of the places that nothing can be learnt.
    """
    places = np.asarray(views.camtoworlds, np.float64)[:, :, 3]
    if len(places) < 2:
        return
    away = np.linalg.norm(places - np.median(places, axis=0), axis=1)
    far = int(np.argmax(away))
    if away[far] <= ONE_PLACE:
        raise ValueError(
            f"{where}: all {len(places)} cameras stand at one place, so that no depth "
            "can be learned"
        )
    if away[far] < MIN_STEPS * step_of(places):
        raise ValueError(
            f"{where}: the cameras' places are so far from the origin "
            f"({np.abs(places).max():.3g}) that rounding has left nothing of how they "
            f"lie to one another ({away[far]:.3g}): take another origin"
        )
    times = away[far] / np.median(away[away > 0])
    named = f"{where}: the camera of {faults.name_of(views.names[far])} stands"
    if times > MAX_FAR:
        raise ValueError(f"{named} {times:.3g} times as far away as the others")
    if times > FAR:
        log.warning("%s %.3g times as far away as the others", named, times)


def step_of(places):
    """The next larger number's distance from the largest of places [n, 3].

    Of float32 where all of them are: whoever has written them had no more.
    """
    with np.errstate(over="ignore"):
        short = places.astype(np.float32)
    largest = np.abs(places if (short != places).any() else short).max()
    return float(np.spacing(largest))


def read_poses(folder, kinds=POSES):
    """The poses.json of a scene; ValueError, naming it, where it is none."""
    return json_files.read(pathlib.Path(folder) / "poses.json", kinds)


def is_accepted(adjustment):
    """Whether held-out matches have accepted cameras that were adjusted."""
    return isinstance(adjustment, dict) and adjustment.get("accepted") is True


def adjustment_of(poses):
    """What a poses.json says of adjusting its cameras; {} where it was not asked."""
    return part_of(part_of(poses, "camera_check"), "adjustment")


def part_of(content, key):
    """A mapping in a mapping; {} where there is none."""
    found = content.get(key)
    return found if isinstance(found, dict) else {}


def is_name(name):
    """Whether a text can be a view's name: a file's that lies in a folder and prints.

    No folder, no hidden file and, as the tables are CSVs, no formula of a spreadsheet,
    which could run a program.
    """
    letters = set(map(unicodedata.category, name))
    size = len(name.encode(errors="replace"))
    return (
        0 < size <= MAX_NAME_BYTES
        and not name.startswith(".")
        and not set(name) & set("/\\")
        and not FORMULA.match(unicodedata.normalize("NFKC", name))
        and not letters & set(NO_LETTERS)
    )


def check_names(path, names):
    """Views' names are names of files, each in the folder that it is looked for in."""
    for name in names:
        if not is_name(name):
            raise ValueError(f"{path}: {faults.shown(name)} cannot be a view's name")
    if len(set(names)) < len(names):
        name = max(names, key=names.count)
        raise ValueError(f"{path}: two views have the name {faults.shown(name)}")


def check_images(scene: Scene, views, folder):
    """Raise early, by the files' heads, most of the errors of `read_images`."""
    for view in views:
        path = _image_path(scene, view, folder)
        images.check(path, size=(scene.width, scene.height))


def _image_path(scene, view, folder):
    return pathlib.Path(folder) / f"{scene.names[view]}.png"


def read_images(scene: Scene, views, folder) -> np.ndarray:
    """Images [views, h, w, 3] uint8 of these views from a folder of PNGs.

    Images are decoded in threads into one array, so that only one copy is in memory.
    """
    stack = empty_images((len(views), scene.height, scene.width, 3))

    def read(slot):
        path = _image_path(scene, views[slot], folder)
        stack[slot] = images.read(path, size=(scene.width, scene.height))

    for _ in machine.map_in_threads(read, range(len(views))):
        pass
    return stack


def empty_images(shape):
    """An uninitialised uint8 array at an address that JAX takes without a copy."""
    size = math.prod(shape)
    buffer = np.empty(size + ALIGNMENT, np.uint8)
    start = -buffer.ctypes.data % ALIGNMENT
    return buffer[start : start + size].reshape(shape)


def read_masks(scene: Scene, views) -> np.ndarray:
    """Masks [views, h, w] bool of the photos' pixels that count; usually all do."""
    folder = scene.folder / MASKS
    if folder.is_dir():
        return read_validity(scene, views, folder)
    return np.ones((len(views), scene.height, scene.width), bool)


def read_validity(scene: Scene, views, folder) -> np.ndarray:
    """Masks [views, h, w] bool of these views from a folder of flow archives.

    A view whose flow is nowhere valid has none. Raises ValueError naming the file.
    """
    masks = np.empty((len(views), scene.height, scene.width), bool)
    for slot, view in enumerate(views):
        path = pathlib.Path(folder) / f"{scene.names[view]}.npz"
        mask = archives.read(path, ["valid"])["valid"]
        if mask.shape != masks.shape[1:]:
            raise ValueError(f"{path}: valid is {mask.shape}, not {masks.shape[1:]}")
        masks[slot] = mask
    return masks
