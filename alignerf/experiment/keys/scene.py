"""Keys of `scenes`: where images and cameras come from, how long each is trained."""

from typing import Literal

import pydantic

from alignerf.captures import base
from alignerf.experiment.keys.key import ONE_LENGTH, PATH, Keys, budget, key
from alignerf.io.environment import extensions

SOURCES = base.every()


def having(key):
    """Names of the sources that have a key of their own."""
    return ", ".join(name for name, one in SOURCES.items() if key in one.keys)


CAMERA_MODELS = Literal[
    "SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"
]


# Mistakes of files of cameras (`alignerf.sfm.mistakes`; a test holds both equal).
ROLLS = ("", "roll_90", "roll_180", "roll_270")
AXES = [f"{f}_{r}".strip("_") for f in ("", "opencv", "ros", "enu") for r in ROLLS][1:]
MEANINGS = ("world_to_camera", "xyzw", "xyzw_camera_to_world", "wxyz")
CONVENTIONS = ("as_stated", *AXES, *MEANINGS)
CONVENTIONS += tuple(f"{meaning}_{axes}" for meaning in MEANINGS for axes in AXES)
CONVENTIONS += tuple(f"{w}_{x}" for w in ("left_handed", "mirrored") for x in "xyz")
CONVENTIONS += ("natural_order", "name_order", "reversed_order")
# Keys that some sources have alone.
OWN = ("images", "background", "masks")
# A name becomes a folder: no path escapes by it.
NAME = r"^(?!.*\.\.)[A-Za-z0-9][A-Za-z0-9_.-]{0,99}\Z"


class Colmap(Keys):
    max_size_px: int = key(
        1600, "COLMAP sees photos of at most this side, in px", least=64, most=20000
    )
    camera_model: CAMERA_MODELS | None = key(
        None, "COLMAP's camera model; null: OPENCV, of courtyard SIMPLE_PINHOLE"
    )
    min_registered: float = key(
        0.6,
        "fraction of the photos that must be registered in one model; with fewer the "
        "run stops",
        least=0,
        most=1,
    )


class Crop(Keys):
    """Crops of each photo of another scene, at its own size, around its points."""

    of: str = key(
        what="another scene, whose photos, split and cameras the crops have; they "
        "belong to its verdict"
    )
    px: int = key(256, "side of a crop in px, at most", least=32, most=8192)
    cameras: str | None = key(
        None,
        "a method of that scene, whose cameras the crops have; null: the input ones",
    )
    count: int = key(1, "crops of each photo", least=1, most=16)


class Common(Keys):
    """Keys of every scene, which stand before the sections of the sources."""

    source: Literal[tuple(SOURCES)] = key(
        what="; ".join(f"{name}: {one.what}" for name, one in SOURCES.items())
    )
    path: PATH | None = key(
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
        f"of {having('background')}: what lies behind transparent "
        "pixels; null refuses them",
    )
    masks: PATH | None = key(
        None,
        "of photos: folder of <photo's file name>.png, black where a photo does not "
        "count, as COLMAP has them",
    )
    poses: Literal["colmap", "truth", "input", "adjusted"] | None = key(
        None,
        "photos have colmap, courtyard colmap (default) or truth; cameras that came "
        "with the photos are adjusted (default: by bundle adjustment, where held-out "
        "matches gain by it) or input (as they came); apps have colmap, too",
    )
    pose_convention: Literal[CONVENTIONS] | None = key(
        None,
        "a mistake in the file of input cameras, which is undone; null: where matches "
        "show one, adjusted cameras have it undone, and of input ones the run stops; "
        "as_stated: there is none",
    )
    adjust_again: bool | None = key(
        None,
        "COLMAP's poses, and adjusted ones, are adjusted a second time, by keypoints "
        "evenly over each view; null: true, but false for courtyard",
    )
    downscale: int | Literal["auto"] = key(
        1,
        "photos are made smaller by this factor, by area averaging; auto: the least "
        "with which all photos together have at most 10 million pixels",
        least=1,
        most=64,
    )
    test_every: int | Literal["auto"] | None = key(
        None,
        "every n-th photo by name is held out; auto: 8, of 17 to 32 photos an n that "
        "holds out 5; null: 8 for llff and mipnerf360, as published, else auto; "
        "blender's files, and a transforms.json with train_filenames and "
        "test_filenames, say it themselves",
        least=2,
        most=10000,
    )
    min_train_views: int = key(
        3,
        "with fewer training views the run stops",
        least=1,
        most=10000,
    )
    crop: Crop | None = key(
        None,
        "the scene is full-resolution crops of another one's photos",
    )
    seed: int | None = key(
        None,
        "random seed of this scene; null: the config's",
        least=0,
        most=2**32 - 1,
    )
    steps: int | None = key(
        None,
        "steps of this scene's trainings; null: those under training",
        least=1,
        most=10**8,
    )
    budget_min: float | None = budget(
        "minutes of each of this scene's trainings, instead of steps; null: those "
        "under training"
    )
    perturb_px: float = key(
        0.0,
        "error added to the poses on purpose, in px of the training size (rms at the "
        "image's center)",
        least=0,
        most=1000,
    )
    perturb_by: Literal["rotation", "translation", "both"] = key(
        "rotation",
        "the error's kind: cameras turn, with one error at every depth; or translate "
        "across their axes, with perturb_px at the depth of the point that they look "
        "at, and less beyond; or both, with perturb_px together",
    )
    triangulate: bool | None = key(
        None,
        "matches and points are found, which check and adjust cameras; null: for "
        "input cameras (COLMAP's poses have their own); true: also for courtyard's "
        "true ones; false: never",
    )
    colmap: Colmap = key(Colmap, "how COLMAP finds poses")

    @property
    def foreign(self):
        """Sections of other sources."""
        return SECTIONS.keys() - {self.source}

    def faults(self):
        source = base.of(self)
        poses, name = source.poses_of(self), source.name
        if poses not in source.poses:
            possible = " or ".join(source.poses)
            yield (
                "poses",
                f"{poses!r} is not possible for source {name!r}, only {possible}",
            )
        if source.has_path and not self.path:
            yield "path", f"source {name!r} needs one"
        for own in OWN:
            if getattr(self, own) and own not in source.keys:
                yield own, f"source {name!r} has none"
        for other in self.foreign:
            # Whole sections of defaults stand in every complete config.
            if self.default(other) is None and getattr(self, other) is not None:
                yield other, f"goes with source {other!r}, and that with it"
        if poses == "adjusted" and self.triangulate is False:
            yield "triangulate", "adjusted poses need matches"
        if poses not in base.INPUT and self.pose_convention:
            yield "pose_convention", "only of cameras that came with the photos"
        if self.test_every is not None and source.says_split:
            yield "test_every", f"{name}'s files say what is held out"
        if self.steps and self.budget_min:
            yield ONE_LENGTH
        yield from source.faults(self)


SECTIONS = {name: one.section for name, one in SOURCES.items() if one.section}
extensions.check_new("captures", SECTIONS, Common.model_fields)
Scene = pydantic.create_model("Scene", __base__=Common, **SECTIONS)
