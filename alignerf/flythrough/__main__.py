"""A film along a camera path, before and after: `python -m alignerf.flythrough`.

Frames are kept in a folder beside the film while it is made: a run that was killed goes
on from them. The size is such that two minutes are enough, by what the views of the
test set took; it is never larger than that of training.
"""

import argparse
import logging
import shutil
from pathlib import Path

from alignerf.experiment.tables import json_rows, sides
from alignerf.files import faults, images, machine
from alignerf.flythrough import film, nerfstudio, rendering
from alignerf.processes import devices
from alignerf.scenes import prepared

log = logging.getLogger("alignerf")


def main(argv=None):
    args = parse(argv)
    machine.limit(args.threads)
    devices.take_accelerator()
    every = json_rows.read(sides.Side, args.sides, "--sides")
    loaded = prepared.load(args.scene)
    path = nerfstudio.read(args.camera_path)
    poses, of_frame = rendering.frames(path)
    size = rendering.size_of(loaded, path, every, len(poses))
    seconds = len(of_frame) / path.fps
    log.info("a film of %.0f s: %d views of %dx%d", seconds, len(poses), *size)
    folder = Path(args.frames)
    rendering.render_all(loaded, path, poses, every, size, folder)

    def shown(frame):
        files = [rendering.file_of(folder, side, frame) for side in range(len(every))]
        return [images.read(file, size=size) for file in files]

    moments = (shown(frame) for frame in of_frame)
    film.write(args.out, moments, path.fps, [side.label for side in every])
    shutil.rmtree(folder, ignore_errors=True)
    log.info("film: %s", args.out)


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(prog="alignerf.flythrough", description=__doc__)
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--camera-path", required=True, help="camera_path.json")
    parser.add_argument("--sides", required=True, help="models, as JSON of Side")
    parser.add_argument("--frames", required=True, help="folder, gone in the end")
    parser.add_argument("--out", required=True, help="film (.webm), written")
    parser.add_argument("--threads", type=int, help="at most (default: every core)")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
