"""The matches of photos whose poses COLMAP has found, from its own database."""

from pathlib import Path

import numpy as np
import pycolmap

from alignerf.files import archives
from alignerf.scenes import prepare
from alignerf.sfm import calibration, matches

KEYS = ("names", "camtopix", "distortion", "sizes")


def read(work, views: prepare.PosedViews, *, seed) -> matches.Matches:
    """The matches of views, in px of theirs, as COLMAP has left them in `work`.

    Its keypoints are of copies of the photos as taken: the lens that it found is undone
    by the same arithmetic as in the photos.
    """
    lenses = archives.read(Path(work) / "lenses.npz", KEYS)
    place = {name: i for i, name in enumerate(lenses["names"].tolist())}
    with pycolmap.Database.open(Path(work) / "database.db") as file:
        found = {
            image.name.removesuffix(".png"): image for image in file.read_all_images()
        }
        sizes = {camera.camera_id: camera for camera in file.read_all_cameras()}
    camtopix, to_pixels = np.linalg.inv(views.pixtocams), {}
    for i, name in enumerate(views.names):
        lens = lenses["camtopix"][place[name]]
        # The lens is of the whole photo; keypoints are of a copy.
        copy = sizes[found[name].camera_id]
        whole = lenses["sizes"][place[name]]
        scale = np.array([copy.width, copy.height]) / whole
        of_copy = np.diag([*scale, 1.0]) @ lens
        to_pixels[name] = _to_view(
            of_copy, lenses["distortion"][place[name]], camtopix[i]
        )
    ids = {name: found[name].image_id for name in views.names}
    size = views.width, views.height
    return matches.read(
        Path(work) / "database.db", ids, size, seed=seed, to_pixels=to_pixels
    )


def _to_view(of_copy, distortion, camtopix):
    """A function: keypoints of a copy -> px of the pinhole view."""
    from_copy = camtopix @ np.linalg.inv(of_copy)

    def move(xy):
        straight = calibration.pinhole_points(xy, of_copy, distortion)
        return straight @ from_copy[:2, :2].T + from_copy[:2, 2]

    return move
