"""The cost of a view's flow: `flow.align` on some photos and blurred copies."""

import csv
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2

from alignerf.files import images
from alignerf.preflight import schedule

# Of small photos some more: on a machine that has other work too, a process of less
# than a second has more than its share.
VIEWS, MORE_VIEWS, MORE_PIXELS = 2, 8, 300_000
BLUR_PX = 1.0


def measure(photos, names, options) -> schedule.Flow:
    """Seconds and bytes of these photos' flow, with the command's options.

    Raises ValueError with the command's error where it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        root, photos = Path(folder), Path(photos)
        for kind in ("photos", "renders"):
            (root / kind).mkdir()
        for name in names[: how_many(images.read(photos / f"{names[0]}.png"))]:
            photo = images.read(photos / f"{name}.png")
            images.write(root / "photos" / f"{name}.png", photo)
            soft = cv2.GaussianBlur(photo, (0, 0), BLUR_PX)
            images.write(root / "renders" / f"{name}.png", soft)
        command = [sys.executable, "-m", "flow.align", *options]
        for name in ("renders", "photos"):
            command += [f"--{name}", str(root / name)]
        for name in ("flow", "warped", "stats"):
            command += [f"--{name}-out", str(root / name)]
        begun = time.perf_counter()
        done = subprocess.run(command, capture_output=True, text=True)
        whole_s = time.perf_counter() - begun
        if done.returncode:
            raise ValueError(f"flow.align: {done.stderr.strip()[-300:]}")
        with open(root / "stats", newline="", encoding="utf-8") as file:
            times_s = [float(row["time_s"]) for row in csv.DictReader(file)]
        return schedule.Flow(
            start_s=whole_s - sum(times_s),
            view_s=sum(times_s) / len(times_s),
            flow_bytes=mean_size(root / "flow"),
            warped_bytes=mean_size(root / "warped"),
        )


def how_many(photo):
    """Number of photos of this size to measure."""
    pixels = photo.shape[0] * photo.shape[1]
    return min(max(VIEWS, MORE_PIXELS // pixels), MORE_VIEWS)


def mean_size(folder):
    """Mean size in bytes of a folder's files."""
    sizes = [path.stat().st_size for path in Path(folder).iterdir()]
    return sum(sizes) // len(sizes)
