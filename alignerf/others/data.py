"""What another program learns from, as files.

One folder with images/, transforms.json (nerfstudio, instant-ngp), sparse/0 with points
(COLMAP, Gaussian splatting) and masks/ where not all pixels count, all at the scene's
training size. Training views have the photos of the round, test views theirs as taken;
all have the cameras of the round.
"""

from pathlib import Path

import numpy as np

from alignerf.exports import formats, photos, points, warps
from alignerf.files import atomic
from alignerf.scenes import prepared


def write(out, scene, *, cameras=None, warped=None, valid=None, seed=0):
    """Write the folder `out` of a prepared scene.

    cameras: cameras.npz, if not the scene's. warped: folder of photos, if not the
    scene's; valid: of <view>.npz with valid pixels. seed: of the points.
    """
    own, out = Path(scene) / "cameras.npz", Path(out)
    path = Path(cameras or own)
    loaded = prepared.load(scene, cameras)
    prepared.check_images(loaded, range(len(loaded.names)), loaded.folder / "images")
    views = photos.as_trained(loaded, path)
    if valid:
        views = warps.as_trained(
            views, loaded, warped or loaded.folder / "images", valid
        )
    moved = photos.has_moved(prepared.read_cameras(own), prepared.read_cameras(path))
    with (
        atomic.replace_folder(out) as folder,
        atomic.scratch_folder(out.parent, name="points") as work,
    ):
        masked = photos.write(folder, views, alpha=False)
        arrays = photos.arrays_of(views)
        # Test views stay where they were given: their cameras agree with no others.
        agreeing = np.arange(len(views.names))
        if moved:
            agreeing = points.agreeing(arrays, ())
        model, _ = points.of(
            *(folder, work, arrays, views.points),
            seed=seed,
            moved=moved,
            views=agreeing,
        )
        formats.write_colmap(folder, model, arrays)
        formats.write_transforms(
            folder / "transforms.json",
            arrays,
            masked=masked,
            points=(folder / formats.POINTS).is_file(),
        )
