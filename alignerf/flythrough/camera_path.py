"""Write a smooth path through a scene's own cameras: camera_path.json.

As nerfstudio's `ns-render camera-path` takes it, in the frame of the scene's cameras:
that of the `transforms.json` of its export. nerfstudio trains in a frame of its own;
with --dataparser, the dataparser_transforms.json beside its config.yml, the path goes
there. Where it has trained on your own transforms.json instead of on the export, say
that with --data.
"""

import argparse
import logging

import numpy as np

from alignerf.exports import formats
from alignerf.files import atomic, faults, json_files
from alignerf.flythrough import nerfstudio, paths
from alignerf.scenes import cameras, prepared

log = logging.getLogger("alignerf")


def main(argv=None):
    args = parse(argv)
    path = of_scene(args.scene)
    if args.dataparser:
        to_theirs = nerfstudio.read_transforms(args.dataparser, args.data)
        path = nerfstudio.in_frame(path, *to_theirs)
    elif args.data:
        raise ValueError("--data goes with --dataparser")
    with atomic.replace_file(args.out) as temporary:
        formats.write_json(temporary, nerfstudio.content(path))
    seconds = len(path.poses) / path.fps
    log.info("%s: %d cameras, %.0f s", args.out, len(path.poses), seconds)


def of_scene(folder):
    """The path through a scene's cameras, in the frame that these are given in.

    Its field of view is the median of theirs, its size that of the photos.
    """
    scene = prepared.load(folder)
    own = scene.folder / "cameras.npz"
    try:
        poses = paths.through(scene.camtoworlds)
    except ValueError as error:
        raise ValueError(f"{own}: {error}") from None
    given = cameras.frame_of(prepared.read_cameras(own)["camtoworlds"]).given(poses)
    focal_px = 1 / np.median(scene.pixtocams[:, 1, 1])
    fov_deg = nerfstudio.fov_deg(focal_px, scene.height)
    size = even_size(scene.width, scene.height, photo_width(scene))
    fields = np.full(len(given), fov_deg)
    return nerfstudio.CameraPath(given, fields, *size, paths.FPS)


def photo_width(scene):
    """Width of the photos as they came in, in px; of training where nobody says."""
    report = scene.folder / "poses.json"
    if not report.is_file():
        return scene.width
    return json_files.read(report, prepared.POSES)["photo_width"]


def even_size(width, height, wanted):
    """(width, height) near to a wanted width: even, as films have it."""
    scale = wanted / width
    return tuple(max(2, 2 * round(scale * side / 2)) for side in (width, height))


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog="alignerf.flythrough.camera_path", description=__doc__
    )
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--dataparser", help="nerfstudio's dataparser_transforms.json")
    parser.add_argument("--data", help="transforms.json that nerfstudio trained on")
    parser.add_argument("--out", required=True, help="camera_path.json, written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
