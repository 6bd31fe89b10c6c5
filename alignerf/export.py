"""Write cameras and photos for other programs: `python -m alignerf.export`.

One folder with images/, transforms.json (nerfstudio, instant-ngp) and sparse/0 (COLMAP,
Gaussian splatting). Where photos are warped, the training views have the warped photos,
and masks/ says which pixels are valid; the other views keep their photos. COLMAP's
points are exported with its poses. A scene that came as LLFF's poses_bounds.npy or as
one of NeRF's synthetic scenes is written in that format too.
"""

import argparse
import logging
import shutil
from pathlib import Path

import numpy as np
from PIL import Image

from alignerf.files import archives, atomic, faults, images, json_files
from alignerf.scenes import exported, prepared

log = logging.getLogger("alignerf")


def main(argv=None):
    args = parse(argv)
    if (args.warped is None) != (args.valid is None):
        raise ValueError("--warped and --valid go together")
    if args.if_pays and not pays(*args.if_pays):
        args.cameras = args.warped = args.valid = None
    loaded = prepared.load(args.scene, args.cameras)
    arrays = prepared.read_cameras(args.cameras or loaded.folder / "cameras.npz")
    warped = loaded.views("train") if args.warped else np.zeros(0, int)
    synthetic = source_of(loaded.folder) == "blender"
    with atomic.replace_folder(args.out) as folder:
        (folder / "images").mkdir()
        for view, name in enumerate(loaded.names):
            source = args.warped if view in warped else loaded.folder / "images"
            # Whole, and of the scene's size, before it is handed on.
            prepared.read_images(loaded, [view], source)
            photo, target = Path(source) / f"{name}.png", folder / f"images/{name}.png"
            (copy_with_alpha if synthetic else shutil.copyfile)(photo, target)
        masked = args.warped is not None or (loaded.folder / prepared.MASKS).is_dir()
        if masked:
            write_masks(folder / "masks", loaded, warped, args.valid)
        points = loaded.folder / prepared.POINTS
        if points.is_file():
            arrays |= archives.read(points, ("points", "colours"))
        exported.write_colmap(folder, arrays)
        path = folder / "transforms.json"
        scene = exported.write_transforms(path, arrays, masked=masked)
        if synthetic:
            write_blender(folder, arrays, scene)
        bounds = loaded.folder / prepared.BOUNDS
        if bounds.is_file():
            write_llff(folder / "poses_bounds.npy", arrays, bounds)


def pays(verdict, method):
    """Whether verdict.json says that a method's alignment paid; logged where not."""
    gains = json_files.read(verdict, {"gains": list})["gains"]
    own = [gain for gain in gains if gain.get("method") == method]
    if any(gain.get("pays") is True for gain in own):
        return True
    log.warning(
        "%s did not show in this run that it brings more than chance, or too few "
        "photos are held out to tell: all goes out as given",
        method,
    )
    return False


def source_of(folder):
    """The source of a scene by its poses.json; None where that does not say."""
    report = folder / "poses.json"
    return json_files.read(report).get("source") if report.is_file() else None


def copy_with_alpha(source, target):
    """A photo with an alpha of one, as readers of NeRF's synthetic scenes need it."""
    with Image.open(source) as image:
        image.convert("RGBA").save(target)


def write_masks(folder, loaded, warped, valid):
    """Write a mask of every view: nerfstudio takes one for each photo, or none.

    warped: views of which the folder `valid` says which pixels hold.
    """
    folder.mkdir()
    for view, name in enumerate(loaded.names):
        (mask,) = prepared.read_masks(loaded, [view])
        if view in warped:
            mask &= prepared.read_validity(loaded, [view], valid)[0]
        images.write_mask(folder / f"{name}.png", mask)


def write_blender(folder, arrays, scene):
    """Write the files of NeRF's synthetic scenes, or log why they cannot be."""
    try:
        exported.write_blender(folder, arrays, scene)
    except ValueError as error:
        log.warning("transforms_train.json is not written: %s", error)


def write_llff(path, arrays, bounds):
    """Write poses_bounds.npy, or log why not. bounds: the file of the depths."""
    depths = archives.read(bounds, ["bounds"])["bounds"]
    if depths.shape != (len(arrays["names"]), 2):
        raise ValueError(f"{bounds}: {depths.shape} is not two depths for each view")
    try:
        exported.write_llff(path, arrays, depths)
    except ValueError as error:
        log.warning("%s is not written: %s", path.name, error)


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--cameras", help="cameras.npz (default: the scene's)")
    parser.add_argument("--warped", help="folder of warped photos of training views")
    parser.add_argument("--valid", help="folder of <view>.npz with their valid pixels")
    parser.add_argument(
        "--if-pays",
        nargs=2,
        metavar=("VERDICT", "METHOD"),
        help="verdict.json and a method: where that brought nothing, all is as given",
    )
    parser.add_argument("--out", required=True, help="folder, written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
