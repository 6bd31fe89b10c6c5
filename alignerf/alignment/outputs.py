"""What a training that aligned itself has learnt from, as files for other stages."""

from pathlib import Path

import numpy as np

from alignerf.command import images, whole
from alignerf.scenes import prepared
from alignerf.training import batches


def write(folder, given, scene: prepared.Scene, chosen, views, cameras=None):
    """Write cameras.npz, and of the views `chosen` photos/<view>.png, valid/<view>.npz.

    given, scene: with its cameras as they were and as they are now. views: a
    `batches.Views`, the photos as warped in the end, or as taken, and where they hold.
    cameras: the file that the training began with; the poses of views that did not move
    stay as they are there, to the bit.
    """
    folder = Path(folder)
    moved = (scene.camtoworlds != given.camtoworlds).any(axis=(1, 2))
    with whole.replace_file(folder / "cameras.npz") as path:
        prepared.write_cameras(path, scene, cameras, moved)
    with (
        whole.replace_folder(folder / "photos") as photos,
        whole.replace_folder(folder / "valid") as valid,
    ):
        for slot, view in enumerate(chosen):
            name = scene.names[view]
            images.write(photos / f"{name}.png", np.asarray(views.photos[slot]))
            counts = batches.unpack_valid(views.valid[slot], scene.width)
            np.savez_compressed(valid / f"{name}.npz", valid=counts)
