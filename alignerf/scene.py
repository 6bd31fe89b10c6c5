"""A prepared scene folder, as every stage after the poses reads it.

`images/<view>.png`, and `cameras.npz` with pixtocams [n, 3, 3], camtoworlds
[n, 3, 4], names [n], width, height, split [n] ('train' or 'test').
"""

import dataclasses
import pathlib

import numpy as np
from PIL import Image

from alignerf import archives, cameras

SPLITS = ("train", "test")


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


def load(folder) -> Scene:
    """Read and check a scene's cameras; poses come out normalised."""
    path = pathlib.Path(folder) / "cameras.npz"
    data = archives.read(
        path, ("pixtocams", "camtoworlds", "names", "width", "height", "split")
    )
    count = len(data["names"])
    shapes = {"pixtocams": (count, 3, 3), "camtoworlds": (count, 3, 4)}
    for key, shape in shapes.items():
        if data[key].shape != shape or not np.isfinite(data[key]).all():
            raise ValueError(f"{path}: {key} is not a finite array of shape {shape}")
    if bad := set(data["split"].tolist()) - set(SPLITS):
        raise ValueError(f"{path}: split holds {sorted(bad)[0]!r}")
    camtoworlds, _ = cameras.normalize_poses(data["camtoworlds"])
    return Scene(
        folder=pathlib.Path(folder),
        names=data["names"].tolist(),
        split=data["split"],
        pixtocams=data["pixtocams"],
        camtoworlds=camtoworlds,
        width=int(data["width"]),
        height=int(data["height"]),
    )


def read_image(path, *, width=None, height=None) -> np.ndarray:
    """8-bit RGB image [h, w, 3]; a wrong size or a broken file is named."""
    try:
        with Image.open(path) as image:
            pixels = np.asarray(image.convert("RGB"))
    except (OSError, SyntaxError) as error:
        raise ValueError(f"{path}: not a readable image ({error})") from None
    if width is not None and pixels.shape[:2] != (height, width):
        raise ValueError(
            f"{path}: {pixels.shape[1]}x{pixels.shape[0]} pixels, "
            f"the scene has {width}x{height}"
        )
    return pixels


def read_images(scene: Scene, views, folder) -> np.ndarray:
    """Images [views, h, w, 3] uint8 of these views from a folder of PNGs."""
    images = np.empty((len(views), scene.height, scene.width, 3), np.uint8)
    for slot, view in enumerate(views):
        path = pathlib.Path(folder) / f"{scene.names[view]}.png"
        images[slot] = read_image(path, width=scene.width, height=scene.height)
    return images


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
