"""Write what another program learns from: `python -m alignerf.others.data`.

One folder with images/, transforms.json (nerfstudio, instant-ngp), sparse/0 with points
(COLMAP, Gaussian splatting) and masks/ where not all pixels count, all at the scene's
training size. Training views have the photos of the round, test views theirs as taken;
all have the cameras of the round.
"""

import argparse
from pathlib import Path

import numpy as np

from alignerf.exports import formats, photos, points, sizes, warps
from alignerf.files import atomic, faults
from alignerf.scenes import prepared


def main(argv=None):
    args = parse(argv)
    own = Path(args.scene) / "cameras.npz"
    path = Path(args.cameras or own)
    loaded = prepared.load(args.scene, args.cameras)
    prepared.check_images(loaded, range(len(loaded.names)), loaded.folder / "images")
    views = sizes.as_trained(loaded, path)
    if args.valid:
        warped = args.photos or loaded.folder / "images"
        views = warps.as_trained(views, loaded, warped, args.valid)
    moved = photos.has_moved(prepared.read_cameras(own), prepared.read_cameras(path))
    out = Path(args.out)
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
            seed=args.seed,
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


def parse(argv=None):
    """Arguments of the command line."""
    parser = argparse.ArgumentParser(
        prog="alignerf.others.data",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--cameras", help="cameras.npz (default: the scene's)")
    parser.add_argument("--photos", help="folder of photos (default: the scene's)")
    parser.add_argument("--valid", help="folder of <view>.npz with valid pixels")
    parser.add_argument("--seed", type=int, default=0, help="of the points")
    parser.add_argument("--out", required=True, help="folder, written")
    return parser.parse_args(argv)


if __name__ == "__main__":
    faults.run(main)
