"""The corrected cameras and warped photos of an aligned training, as files."""

import numpy as np

from alignerf.files import images
from alignerf.scenes import prepared
from alignerf.training import batches


def write_cameras(path, original, scene: prepared.Scene, cameras=None):
    """Write a scene's cameras as they are now.

    original: the scene with its cameras as they were. cameras: the file of these; the
    poses of views that did not move stay as they are there, to the bit.
    """
    moved = (scene.camtoworlds != original.camtoworlds).any(axis=(1, 2))
    prepared.write_cameras(path, scene, cameras, moved)


def write_photos(folder, names, views):
    """Write photos/<view>.png and valid/<view>.npz of views of these names.

    views: a `batches.Views`, the photos as warped in the end and where they hold.
    """
    for kind in ("photos", "valid"):
        (folder / kind).mkdir()
    for slot, name in enumerate(names):
        images.write(folder / "photos" / f"{name}.png", np.asarray(views.photos[slot]))
        counts = batches.unpack_valid(views.valid[slot], views.photos[slot].shape[1])
        np.savez_compressed(folder / "valid" / f"{name}.npz", valid=counts)
