"""castle_P30's surveyed cameras (Strecha et al. 2008) as a capture of nerfstudio's.

    python -m tools.bench.surveyed ../shared/data/scenes/castle_P30 results/castle_P30

The folder that is made has a transforms.json and links to the photos; a config reads it
by `source: transforms`. The photos are half as large as those that were surveyed. The
survey counts the middle of a pixel as whole, nerfstudio's file as half: the photos'
own matches fit that better than a survey that counts halves, though weakly.
"""

import argparse
import json
from pathlib import Path

import numpy as np

# Surveyed pixels to one of the photos.
SHRINK = 2


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("capture", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args(argv)
    folder = args.out / "images"
    folder.mkdir(parents=True, exist_ok=True)
    frames = []
    for photo in sorted((args.capture / f"images_{SHRINK}").glob("*.jpg")):
        link = folder / photo.name
        link.unlink(missing_ok=True)
        link.symlink_to(photo.resolve())
        survey = args.capture / "gt_dense_cameras" / f"{photo.name}.camera"
        camtopix, pose, (width, height) = read(survey)
        frame = {"file_path": f"images/{photo.name}"}
        lens = camtopix[[0, 1, 0, 1], [0, 1, 2, 2]] / SHRINK
        frame |= dict(zip(("fl_x", "fl_y", "cx", "cy"), lens, strict=True))
        frame |= {"w": width // SHRINK, "h": height // SHRINK}
        frames.append(frame | {"transform_matrix": pose.tolist()})
    (args.out / "transforms.json").write_text(json.dumps({"frames": frames}, indent=1))


def read(path):
    """(camtopix [3, 3], pose [4, 4] of OpenGL's axes, (width, height)) as surveyed.

    The file has K, three zeros, the rotation from camera to world and the centre, with
    COLMAP's axes, and the size in pixels.
    """
    lines = path.read_text().splitlines()
    rows = [[float(word) for word in line.split()] for line in lines]
    camtopix, pose = np.array(rows[:3]), np.eye(4)
    camtopix[:2, 2] += 0.5
    pose[:3, :3] = np.array(rows[4:7]) @ np.diag([1, -1, -1])
    pose[:3, 3] = rows[7]
    return camtopix, pose, tuple(map(int, rows[8]))


if __name__ == "__main__":
    main()
