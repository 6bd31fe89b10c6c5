"""A trajectory as TUM's RGB-D benchmark, evo and most SLAM programs write it.

A line is `timestamp tx ty tz qx qy qz qw`: seconds, and camera-to-world with OpenCV's
axes. A photo gets the pose nearest in time. `rgb.txt` beside it has the photos' times
and names; else their names are times. The lens is in `calibration.txt`, as ETH3D's SLAM
benchmark has it: fx fy cx cy in px of the photos, here also k1 k2 p1 p2 k3. Format:
cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats.
"""

import contextlib
from pathlib import Path, PurePosixPath

import numpy as np

from alignerf.io import faults
from alignerf.readers import shots
from alignerf.scenes import photo_names, photos

NAME = "TUM"
PATTERNS = ("*ground*truth*.txt", "*[Tt]raj*.txt", "*.tum")
MARK = rb"(?m)^\d[\d.e+]*([ \t,]+[-+]?[\d.][-+.\de]*){7}\s*$"
# Cameras of 30 Hz take a photo each 0.033 s.
NEAR_S = 0.02
LENS = "fx fy cx cy k1 k2 p1 p2 k3"


def read(path):
    path = Path(path)
    poses = np.array([shots.numbers(*line, 8) for line in lines(path)])
    times = times_of(path)
    if not times:
        raise ValueError(
            f"{path}: no photo beside it has a time in rgb.txt or its name"
        )
    size = photos.head(path.parent / next(iter(times))).size
    lens, found = lens_of(path), []
    for name, time in times.items():
        nearest = int(np.abs(poses[:, 0] - time).argmin())
        values = poses[nearest, 1:]
        if abs(poses[nearest, 0] - time) < NEAR_S:
            pose = shots.pose(shots.rotation_of(values[3:]), values[:3])
            found.append(shots.Shot(name, lens, pose, size))
    if not found:
        raise ValueError(f"{path}: no pose within {NEAR_S} s of any photo's time")
    return found


def lines(path):
    """(where it stands, its words) of each line that is no comment."""
    for number, line in enumerate(faults.text(path).splitlines(), 1):
        if (words := line.replace(",", " ").split()) and words[0][0] != "#":
            yield f"{path}: line {number}", words


def times_of(path):
    """{photo's path beside the trajectory: its time in s}."""
    folder, found = path.parent, {}
    listed = photo_names.listed(folder)
    if (table := folder / "rgb.txt").is_file():
        rows = {}
        for at, words in lines(table):
            time = shots.numbers(at, words[:1], 1)[0]
            if rows.setdefault(words[-1], time) != time:
                raise ValueError(f"{at}: a second time of {faults.name_of(words[-1])}")
        named = photo_names.match(rows, listed, table)
        return {photo: rows[name] for name, photo in named.items()}
    for photo in listed:
        stem = PurePosixPath(photo).stem
        # Whole numbers count frames.
        with contextlib.suppress(ValueError):
            found |= {photo: float(stem)} if "." in stem else {}
    return found


def lens_of(path):
    """(camtopix, distortion) of calibration.txt."""
    file = path.with_name("calibration.txt")
    if not file.is_file():
        raise ValueError(
            f"{path}: it says nothing of the lens: write {file} with `fx fy cx cy` or "
            f"`{LENS}`, in px of the photos"
        )
    words = [word for _, words in lines(file) for word in words]
    if len(words) not in (4, 8, 9):
        raise ValueError(f"{file}: {len(words)} numbers, not `fx fy cx cy` or `{LENS}`")
    values = shots.numbers(file, words, len(words)).tolist()
    return shots.lens(file, "FULL_OPENCV", values + [0.0] * (12 - len(values)))
