"""What a view's flow takes here: `flow.align` on two photos and blurred copies."""

import csv
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2

from alignerf.command import images
from alignerf.preflight import schedule

VIEWS, BLUR_PX = 2, 1.0


def measure(photos, names, options) -> schedule.Flow:
    """Seconds and bytes of these photos' flow, with the command's options.

    Raises ValueError with what the command said, where it fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for kind in ("photos", "renders"):
            (root / kind).mkdir()
        for name in names[:VIEWS]:
            photo = images.read(Path(photos) / f"{name}.png")
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


def mean_size(folder):
    """Bytes of a folder's file."""
    sizes = [path.stat().st_size for path in Path(folder).iterdir()]
    return sum(sizes) // len(sizes)
