"""A prepared scene folder, as every stage after the poses reads it.

`images/<view>.png`, and `cameras.npz` with pixtocams [n, 3, 3], camtoworlds
[n, 3, 4], names [n], width, height, split [n] ('train' or 'test').
"""

import dataclasses
import math
import pathlib

import numpy as np

from alignerf.command import archives, images, machine
from alignerf.scenes import cameras

SPLITS = ("train", "test")
# Folder of <view>.npz {valid}, of scenes whose photos do not count everywhere.
MASKS = "masks"
# Beyond it squares, as of distances between cameras, leave float32.
LARGEST = 1e18
# JAX copies arrays that start elsewhere.
ALIGNMENT = 64


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
    `alignerf.correct_poses`). They come out in the frame of the scene's own, so that
    what was learnt with one is where the other sees it.
    """
    own = pathlib.Path(folder) / "cameras.npz"
    path = pathlib.Path(cameras_path or own)
    data = read_cameras(path)
    given = data if path == own else read_cameras(own)
    for key in ("names", "split", "width", "height"):
        if not np.array_equal(data[key], given[key]):
            raise ValueError(f"{path}: {key} differ from those of {own}")
    frame = cameras.frame_of(given["camtoworlds"])
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
    """Write a cameras.npz like another, with the scene's lenses and these views' poses.

    cameras_path: the other one, as in `load`. The poses of views that are not named
    stay as they are there, to the bit.
    """
    own = scene.folder / "cameras.npz"
    frame = cameras.frame_of(read_cameras(own)["camtoworlds"])
    found = read_cameras(cameras_path or own)
    found["pixtocams"] = scene.pixtocams
    found["camtoworlds"] = found["camtoworlds"].copy()
    found["camtoworlds"][views] = frame.given(scene.camtoworlds[views])
    with open(path, "wb") as file:
        np.savez(file, **found)


def read_cameras(path):
    """The arrays of a cameras.npz, checked; poses are in the given frame."""
    path = pathlib.Path(path)
    data = archives.read(
        path, ("pixtocams", "camtoworlds", "names", "width", "height", "split")
    )
    check_cameras(path, data)
    if bad := set(data["split"].tolist()) - set(SPLITS):
        raise ValueError(f"{path}: split holds {sorted(bad)[0]!r}")
    return data


def check_cameras(path, data):
    """Every view's camera is finite and sees: no ray may lack a direction."""
    names = data["names"].tolist()
    for key, shape in (("pixtocams", (3, 3)), ("camtoworlds", (3, 4))):
        matrices = data[key]
        if matrices.shape != (len(names), *shape):
            raise ValueError(f"{path}: {key} is not an array of {(len(names), *shape)}")
        finite = (np.abs(matrices) < LARGEST).all(axis=(1, 2))
        sees = flatness(np.where(finite[:, None, None], matrices, 0)) > 1e-6
        for good, fault in ((finite, "not finite"), (sees, "singular")):
            if not good.all():
                name = names[int(np.argmin(good))]
                raise ValueError(f"{path}: {key} of view {name!r} is {fault}")


def flatness(matrices):
    """Volumes [n] of the first three columns over those of boxes of their lengths."""
    columns = matrices[:, :, :3]
    lengths = np.linalg.norm(columns, axis=1, keepdims=True)
    return np.abs(np.linalg.det(columns / np.maximum(lengths, 1e-30)))


def check_images(scene: Scene, views, folder):
    """Refuse now, by the file's head, most of what `read_images` refuses."""
    for view in views:
        path = _image_path(scene, view, folder)
        images.check(path, size=(scene.width, scene.height))


def _image_path(scene, view, folder):
    return pathlib.Path(folder) / f"{scene.names[view]}.png"


def read_images(scene: Scene, views, folder) -> np.ndarray:
    """Images [views, h, w, 3] uint8 of these views from a folder of PNGs.

    Decoded side by side, each straight to its place: one copy is in memory.
    """
    found = empty_images((len(views), scene.height, scene.width, 3))

    def read(slot):
        path = _image_path(scene, views[slot], folder)
        found[slot] = images.read(path, size=(scene.width, scene.height))

    for _ in machine.map_in_threads(read, range(len(views))):
        pass
    return found


def empty_images(shape):
    """An uninitialised uint8 array at an address that JAX takes without a copy."""
    size = math.prod(shape)
    buffer = np.empty(size + ALIGNMENT, np.uint8)
    start = -buffer.ctypes.data % ALIGNMENT
    return buffer[start : start + size].reshape(shape)


def read_masks(scene: Scene, views) -> np.ndarray:
    """Masks [views, h, w] bool: where the photos of these views count; all, usually."""
    folder = scene.folder / MASKS
    if folder.is_dir():
        return read_validity(scene, views, folder)
    return np.ones((len(views), scene.height, scene.width), bool)


def read_validity(scene: Scene, views, folder) -> np.ndarray:
    """Masks [views, h, w] bool of these views from a folder of flow archives.

    Raises ValueError where a view has no valid pixel: nothing could be learnt.
    """
    masks = np.empty((len(views), scene.height, scene.width), bool)
    for slot, view in enumerate(views):
        path = pathlib.Path(folder) / f"{scene.names[view]}.npz"
        mask = archives.read(path, ["valid"])["valid"]
        if mask.shape != masks.shape[1:]:
            raise ValueError(f"{path}: valid is {mask.shape}, not {masks.shape[1:]}")
        if not mask.any():
            raise ValueError(f"{path}: no valid pixel")
        masks[slot] = mask
    return masks
