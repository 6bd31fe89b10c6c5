"""Keys of `scenes`: where images and cameras come from, how long each is trained."""

from typing import Literal

import pydantic

from alignerf.captures import base
from alignerf.experiment.keys.key import Keys, budget, key
from alignerf.io.environment import extensions

SOURCES = base.every()


def having(key):
    """Names of the sources that have a key of their own."""
    return ", ".join(name for name, one in SOURCES.items() if key in one.keys)


CAMERA_MODELS = Literal[
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"
]


# Mistakes of files of cameras (`alignerf.sfm.mistakes`; a test holds both equal).
CONVENTIONS = ("as_stated", "opencv", "world_to_camera", "world_to_camera_opencv")
CONVENTIONS += tuple(f"{w}_{x}" for w in ("left_handed", "mirrored") for x in "xyz")
CONVENTIONS += ("natural_order", "name_order", "reversed_order")
# A name becomes a folder: no path escapes by it.
NAME = r"^(?!.*\.\.)[A-Za-z0-9][A-Za-z0-9_.-]{0,99}\Z"


class Colmap(Keys):
    max_size_px: int = key(
        1600, "features are found on photos of at most this side", least=64, most=20000
    )
    camera_model: CAMERA_MODELS | None = key(
        None, "null takes OPENCV for photos, SIMPLE_PINHOLE for courtyard"
    )
    min_registered: float = key(
        0.6,
        "share of the photos that have to be registered in one model; with fewer the "
        "run stops: what is left would be scored as if it were the scene",
        least=0,
        most=1,
    )


class Crop(Keys):
    """Crops of each photo of another scene, at its own size, around its points."""

    of: str = key(
        what="another scene, whose photos, split and cameras the crops have; they "
        "belong to its verdict, and are made for it or by name"
    )
    px: int = key(256, "side of the crops at most", least=32, most=8192)
    cameras: str | None = key(
        None,
        "a method, whose cameras of that scene the crops have; null: as given",
    )
    count: int = key(
        1, "crops of each photo, at places that suit best", least=1, most=16
    )


class Common(Keys):
    """Keys of every scene, which stand before the sections of the sources."""

    source: Literal[tuple(SOURCES)] = key(
        what="; ".join(f"{name}: {one.what}" for name, one in SOURCES.items())
    )
    path: str | None = key(
        None,
        "folder of photos, of transforms.json, of poses_bounds.npy and images or "
        "images_<n>, of sparse/0 and images_<n>, of transforms_train.json and "
        "transforms_test.json, or an app's; none for courtyard",
    )
    images: int | None = key(
        None,
        f"of {having('images')}: the n of the folder images_<n>, 1 for images; null "
        "takes the largest photos there are",
        least=1,
        most=64,
    )
    background: Literal["black", "white"] | None = key(
        None,
        f"of {having('background')}: what transparent pixels stand on; null refuses "
        "them",
    )
    masks: str | None = key(
        None,
        "of photos: folder of <photo's file name>.png, black where a photo does not "
        "count, as COLMAP has them",
    )
    poses: Literal["colmap", "truth", "input", "adjusted"] | None = key(
        None,
        "courtyard has colmap (default) or truth, photos colmap; cameras that came "
        "with the photos are adjusted (default: by bundle adjustment, where held-out "
        "matches gain by it) or given (as they came); apps have colmap too",
    )
    pose_convention: Literal[CONVENTIONS] | None = key(
        None,
        "of input cameras: the mistake that their file makes, which is undone; null: "
        "none, and where matches show one the run stops and names it; as_stated: none",
    )
    refine_keypoints: bool | None = key(
        None,
        "keypoints of tracks are aligned by patches of the photos at their own size, "
        "and COLMAP's or adjusted cameras adjusted again where held-out tracks gain by "
        "it; null: except for the courtyard, whose error is to be COLMAP's own",
    )
    downscale: int | Literal["auto"] = key(
        1,
        "photos are made smaller by this factor, by area averaging; auto takes the "
        "least with which all photos together have at most 10 million pixels",
        least=1,
        most=64,
    )
    test_every: int | Literal["auto"] | None = key(
        None,
        "every n-th view by name is held out; auto: 8, or of 17 to 32 views what holds "
        "out 5; null: 8 of llff and mipnerf360, as published, else auto; blender's "
        "files, and a transforms.json with train_filenames and test_filenames, say "
        "which themselves",
        least=2,
        most=10000,
    )
    min_train_views: int = key(
        3,
        "with fewer to learn from the run stops: no geometry follows from them",
        least=1,
        most=10000,
    )
    crop: Crop | None = key(
        None,
        "the scene is made of crops of another one's photos; `crops` makes such",
    )
    seed: int | None = key(
        None,
        "of this scene, its poses and its trainings; null takes the config's",
        least=0,
        most=2**32 - 1,
    )
    steps: int | None = key(
        None,
        "of this scene's trainings; null takes the one under training",
        least=1,
        most=10**8,
    )
    budget_min: float | None = budget(
        "minutes of each of this scene's trainings, instead of steps; null takes the "
        "one under training"
    )
    perturb_px: float = key(
        0.0,
        "error added to the poses, in pixels (rms at the image's centre, after "
        "downscale), so that a small image shows the misalignment of a large one",
        least=0,
        most=1000,
    )
    triangulate: bool | None = key(
        None,
        "matches and points of the views are found, which check and adjust cameras; "
        "null: of cameras that came with the photos (COLMAP's poses have their own); "
        "true: also of the courtyard's true ones; false: of none",
    )
    colmap: Colmap = key(Colmap)


SECTIONS = {name: one.section for name, one in SOURCES.items() if one.section}
extensions.check_new("captures", SECTIONS, Common.model_fields)
Scene = pydantic.create_model("Scene", __base__=Common, **SECTIONS)
