"""Crops of a photo and of renders side by side, for a page.

    python -m tools.docs.crops results/SCENE docs/pictures/NAME.jpg
        plain/round0=plain aligned_loss/round0="aligned loss" ...

A row a test view; a column the photo, then each training's render, with its name. Views
and crops are those of `figures/crops.png`: no method decides them.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

from alignerf.io import faults, images
from flow.figures import crops

# Pixels on the page of a pixel of the photo, and of the heading.
SCALE, HEAD = 4, 28


def main(argv=None):
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("trainings", nargs="+", help="FOLDER=NAME")
    args = parser.parse_args(argv)
    folders, names = zip(*(one.split("=", 1) for one in args.trainings), strict=True)
    of = [args.scene / "images", *(args.scene / f / "renders/test" for f in folders)]
    views = crops.choose_views(sorted(path.stem for path in of[1].glob("*.png")))
    rows = []
    for view in views:
        shown = [images.read(folder / f"{view}.png") for folder in of]
        crop = crops.choose_crop(shown[0])
        rows.append(np.concatenate([enlarged(crop.cut(one)) for one in shown], axis=1))
    width = rows[0].shape[1]
    head = np.full((HEAD, width, 3), 255, np.uint8)
    for column, name in enumerate(("photo", *names)):
        at = column * width // len(of) + 4, HEAD - 9
        cv2.putText(head, name, at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, 0, 1, cv2.LINE_AA)
    sheet = np.concatenate([head, *rows])
    cv2.imwrite(str(args.out), sheet[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


def enlarged(image):
    """The image SCALE times as large, with a white border to its right and below."""
    image = image.repeat(SCALE, axis=0).repeat(SCALE, axis=1)
    return np.pad(image, ((0, 4), (0, 4), (0, 0)), constant_values=255)


if __name__ == "__main__":
    faults.run(main)
