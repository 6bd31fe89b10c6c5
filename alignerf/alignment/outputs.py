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


def write_photos(folder, names, views, taken, offsets_px, k):
    """Write photos/<view>.png and valid/<view>.npz of views of these names.

    views: a `batches.Views`, the photos as warped in the end and where they hold;
    taken: before. offsets_px, k: as of `photos.warped`, or None where none is warped.
    They are written beside where the photo holds, so that it can be warped again at
    another size; a photo that stayed as taken has none.
    """
    for kind in ("photos", "valid"):
        (folder / kind).mkdir()
    if offsets_px is None:
        h, w = views.photos.shape[1:3]
        offsets_px = np.zeros((len(names), h // k, w // k, 2), np.float32)
    for slot, name in enumerate(names):
        photo = np.asarray(views.photos[slot])
        images.write(folder / "photos" / f"{name}.png", photo)
        counts = batches.unpack_valid(views.valid[slot], photo.shape[1])
        same = np.array_equal(photo, taken.photos[slot])
        np.savez_compressed(
            folder / "valid" / f"{name}.npz",
            valid=counts,
            offsets_px=np.zeros_like(offsets_px[slot]) if same else offsets_px[slot],
            shrink=k,
        )
