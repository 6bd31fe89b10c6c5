"""Captures of others whose cameras were measured, and their photos at a useful size.

Read are folders of Strecha et al. (2008), of Middlebury's multi-view stereo and of
DTU's scans as NeuS has them. All three count the middle of a pixel as whole: principal
points get half a pixel more. Photos of a capture share one lens, without distortion.
"""

from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from alignerf.scenes import cameras
from alignerf.sfm import calibration
from tools.bench import surveyed

MAX_WIDTH = 768
# Lenses that calibration found for each photo of one camera differ by so many px.
ONE_LENS_PX = 0.1


class Capture(NamedTuple):
    """Photos as they are written, their true cameras, and what a file says of them.

    photos: [h, w, 3] uint8 RGB of each view; true, given: in px of the photos.
    """

    names: list[str]
    photos: list[np.ndarray]
    true: calibration.Cameras
    given: calibration.Cameras

    @property
    def size(self):
        return self.photos[0].shape[1::-1]


def places(folder):
    """{name: folder} of the captures below a folder."""
    marks = ("gt_dense_cameras", "*_par.txt", "cameras.npz")
    return {
        path.parent.name: path.parent
        for mark in marks
        for path in sorted(Path(folder).rglob(mark))
    }


def read(folder) -> Capture:
    """The capture in a folder, its photos at most MAX_WIDTH wide."""
    folder = Path(folder)
    if (folder / "cameras.npz").is_file():
        found = of_dtu(folder)
    elif tables := list(folder.glob("*_par.txt")):
        found = of_middlebury(tables[0])
    else:
        found = of_strecha(folder)
    paths, lenses, poses, sizes = zip(*found, strict=True)
    assert np.ptp(lenses, axis=0).max() < ONE_LENS_PX, folder
    shown = [cv2.imread(str(path))[..., ::-1] for path in paths]
    width, height = sizes[0] or shown[0].shape[1::-1]
    own_width, own_height = shown[0].shape[1::-1]
    now = min(own_width, MAX_WIDTH)
    size = now, round(own_height * now / own_width)
    lens = np.diag([size[0] / width, size[1] / height, 1.0]) @ np.median(lenses, axis=0)
    count = len(paths)
    true = calibration.Cameras(
        np.tile(lens, (count, 1, 1)), np.stack(poses), np.zeros((count, 5))
    )
    photos = [cv2.resize(image, size, interpolation=cv2.INTER_AREA) for image in shown]
    return Capture([path.stem for path in paths], photos, true, true)


def of_strecha(folder):
    """(photo, camtopix, camtoworld, the size of the photo surveyed) of each view."""
    images = folder / "images"
    images = images if images.is_dir() else folder / f"images_{surveyed.SHRINK}"
    for path in sorted(images.glob("*.jpg")):
        survey = folder / "gt_dense_cameras" / f"{path.name}.camera"
        camtopix, pose, size = surveyed.read(survey)
        yield path, camtopix, pose[:3], size


def of_middlebury(table):
    """The same: lines of a photo's name, K, R and t; of photos that are there."""
    for line in table.read_text().splitlines()[1:]:
        name, *words = line.split()
        lens, turn, shift = np.split(np.array(words, float), [9, 18])
        if (path := table.parent / name).is_file():
            yield camera(path, lens.reshape(3, 3), turn.reshape(3, 3), shift)


def of_dtu(folder):
    """The same, of world-to-pixel matrices by the photo's number."""
    with np.load(folder / "cameras.npz") as arrays:
        for path in sorted((folder / "image").glob("*.png")):
            matrix = arrays[f"world_mat_{int(path.stem)}"][:3].astype(float)
            # A camera's determinant is above 0; the matrix has any scale.
            matrix *= np.sign(np.linalg.det(matrix[:, :3]))
            lens, turn, centre, *_ = cv2.decomposeProjectionMatrix(matrix)
            centre = centre[:3, 0] / centre[3, 0]
            lens[0, 1] = 0.0
            yield camera(path, lens / lens[2, 2], turn, -turn @ centre)


def camera(path, lens, turn, shift):
    """A view of world-to-camera by OpenCV's axes, whose pixels' middles are whole."""
    lens[:2, 2] += 0.5
    back = turn.T @ cameras.OPENGL_FROM_OPENCV
    return path, lens, np.column_stack([back, -turn.T @ shift]), None
