"""Real captures with one fault put in, as folders that a config reads.

    python -m tools.bench.planted ../shared/data/scenes results/planted
    snakemake --cores N --configfile workflow/config/planted.yaml

Of fox: 15 of its 50 photos; five photos blurred; exposure that drifts by one stop of
8-bit values from the first photo to the last. Of flower: photos shifted by 4 px both
ways, which is a principal point that is as far off.
"""

import argparse
import json
import shutil
from pathlib import Path

import cv2
import numpy as np

from alignerf.io import images

FEW, BLURRED, BLUR_PX, DRIFT_STOPS, SHIFT_PX = 15, 5, 8.0, 1.0, 4


def main(argv=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("out", type=Path)
    args = parser.parse_args(argv)
    fox = args.scenes / "fox"
    told = json.loads((fox / "transforms.json").read_text())
    # It names frames of the film whose photos were left out.
    there = [one for one in told["frames"] if (fox / one["file_path"]).exists()]
    told["frames"] = sorted(there, key=lambda frame: frame["file_path"])
    few = np.linspace(0, len(told["frames"]) - 1, FEW).round().astype(int)
    fewer = told | {"frames": [told["frames"][i] for i in few]}
    write(args.out / "fox_few", fox, fewer, lambda place, image: image)
    soft = np.random.default_rng(0).permutation(len(told["frames"]))[:BLURRED]
    write(
        args.out / "fox_blurred",
        fox,
        told,
        lambda place, image: blurred(image) if place in soft else image,
    )
    last = len(told["frames"]) - 1
    write(
        args.out / "fox_drift",
        fox,
        told,
        lambda place, image: brighter(image, DRIFT_STOPS * (place / last - 0.5)),
    )
    shift(args.scenes / "flower", args.out / "flower_shifted")


def write(folder, capture, told, changed):
    """A capture of nerfstudio's; changed(place, image) is the photo there."""
    (folder / "images").mkdir(parents=True, exist_ok=True)
    frames = []
    for place, frame in enumerate(told["frames"]):
        image = read(capture / frame["file_path"])
        name = f"images/{Path(frame['file_path']).stem}.png"
        images.write(folder / name, changed(place, image))
        frames.append(frame | {"file_path": name})
    (folder / "transforms.json").write_text(json.dumps(told | {"frames": frames}))


def read(path):
    return cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)


def blurred(image):
    return cv2.GaussianBlur(image, (0, 0), BLUR_PX)


def brighter(image, stops):
    bright = image.astype(np.float32) * 2.0**stops
    return np.clip(np.round(bright), 0, 255).astype(np.uint8)


def shift(capture, folder):
    """A capture of LLFF's; its photos are moved, and their borders go on."""
    (folder / "images_2").mkdir(parents=True, exist_ok=True)
    shutil.copyfile(capture / "poses_bounds.npy", folder / "poses_bounds.npy")
    for path in sorted((capture / "images_2").iterdir()):
        padded = [(SHIFT_PX, 0), (SHIFT_PX, 0), (0, 0)]
        image = np.pad(read(path), padded, "edge")[:-SHIFT_PX, :-SHIFT_PX]
        images.write(folder / "images_2" / f"{path.stem}.png", image)


if __name__ == "__main__":
    main()
