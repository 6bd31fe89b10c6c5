"""A prepared scene with smaller photos: `python -m alignerf.shrink`.

Views, poses and split stay, so that a model trained on the smaller photos can be
rendered and scored at the scene's own size.
"""

import argparse
import pathlib

from alignerf.files import archives, atomic, faults, images
from alignerf.scenes import prepare, prepared


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", required=True, help="prepared scene folder")
    parser.add_argument("--factor", required=True, type=float, help="1 or more")
    parser.add_argument("--out", required=True, help="scene folder, written")
    args = parser.parse_args(argv)
    if not args.factor >= 1:
        raise ValueError(f"--factor: {args.factor} makes no photo smaller")
    loaded = prepared.load(args.scene)
    # As stored: normalising the normalised poses anew could turn the frame.
    stored = archives.read(loaded.folder / "cameras.npz", ["camtoworlds"])
    size = loaded.width, loaded.height

    def read_photo(name):
        return images.read(loaded.folder / "images" / f"{name}.png", size=size)

    def read_mask(view):
        return images.of_mask(prepared.read_masks(loaded, [view])[0])

    masks = [prepare.Photo(view, (read_mask,)) for view in range(len(loaded.names))]
    masked = (loaded.folder / prepared.MASKS).is_dir()
    views = prepare.PosedViews(
        names=loaded.names,
        pixtocams=loaded.pixtocams,
        camtoworlds=stored["camtoworlds"],
        width=loaded.width,
        height=loaded.height,
        photos=[prepare.Photo(name, (read_photo,)) for name in loaded.names],
        masks=masks if masked else None,
    )
    smaller = prepare.downscale(views, args.factor)
    out = pathlib.Path(args.out)
    with atomic.scratch_folder(out) as scratch:
        fresh = scratch / "new"
        prepare.write_views(fresh, smaller, split=loaded.split)
        for path in fresh.iterdir():
            atomic.move(path, out / path.name)


if __name__ == "__main__":
    faults.run(main)
