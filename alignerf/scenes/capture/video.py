"""Frames of a film: sharp ones, far enough from one another and near enough.

The path of the camera is measured in widths of the picture, by optical flow between
frames that follow one another. It is cut into equal pieces, and of each the sharpest
frame is taken.
"""

import itertools
import logging
from pathlib import Path

import cv2
import numpy as np

from alignerf.files import faults, images, progress

log = logging.getLogger(__name__)

SUFFIXES = frozenset([".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm"])
# A piece of the path: views that overlap by nine tenths match well.
STEP_WIDTHS = 0.1
LEAST_FRAMES, MOST_FRAMES = 20, 120
# Measured at this width.
SMALL_PX = 192
# A film with fewer of its frames than this share is cut short.
TRUNCATED = 0.9
# Frames that are looked at; of longer films evenly spaced ones.
MOST_LOOKED_AT = 3000


def find(folder):
    """Paths of the films in a folder, sorted; a film's own path is that alone."""
    if not Path(folder).is_dir():
        film = Path(folder).is_file() and Path(folder).suffix.lower() in SUFFIXES
        return [Path(folder)] if film else []
    return sorted(
        path
        for path in Path(folder).iterdir()
        if path.suffix.lower() in SUFFIXES
        and path.is_file()
        and not path.name.startswith(".")
    )


def without_live_photos(films, photos):
    """The films without live photos, the seconds around a photo of the same name."""
    stems = {path.stem for path in photos}
    live = [film.name for film in films if film.stem in stems]
    if live:
        named = faults.some_names(live)
        log.warning("left out %s: a photo of that name is there", named)
    kept = [film for film in films if film.stem not in stems]
    for first, second in itertools.pairwise(kept):
        if first.stem == second.stem:
            raise ValueError(f"{first} and {second.name} would give the same views")
    return kept


def extract(path, folder):
    """Write a film's chosen frames to <folder>/<film>_<frame>.png; returns the paths.

    Raises ValueError naming the film where it cannot be decoded.
    """
    numbers, sharpness, steps = measure(path)
    told = frame_count(path)
    if numbers[-1] + 1 < TRUNCATED * told:
        log.warning("%s: ends after %d of %d frames", path, numbers[-1] + 1, told)
    chosen = choose(sharpness, steps)
    wanted = {numbers[i] for i in chosen}
    log.info("%s: %d of %d frames", path.name, len(wanted), numbers[-1] + 1)
    written = []
    for number, frame in frames(path, "frames"):
        if number in wanted:
            written.append(Path(folder) / f"{path.stem}_{number:06d}.png")
            images.write(written[-1], cv2.cvtColor(frame, cv2.COLOR_BGR2RGB))
    return written


def measure(path):
    """(frame numbers, sharpness, path in widths since the frame before), each [n]."""
    flow_of = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    numbers, sharpness, steps, before = [], [], [], None
    for number, frame in frames(path, "film"):
        grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
        height = max(16, round(SMALL_PX * grey.shape[0] / grey.shape[1]))
        small = cv2.resize(grey, (SMALL_PX, height), interpolation=cv2.INTER_AREA)
        step = 0.0
        if before is not None:
            lengths = np.linalg.norm(flow_of.calc(before, small, None), axis=-1)
            step = float(np.median(lengths)) / SMALL_PX
        numbers.append(number)
        # Blur takes the fine detail away, whatever the scene.
        sharpness.append(float(cv2.Laplacian(grey, cv2.CV_32F).var()))
        steps.append(step)
        before = small
    if not numbers:
        raise ValueError(f"cannot decode {path}: no frame in it")
    return numbers, np.array(sharpness), np.array(steps)


def choose(sharpness, steps):
    """Places of the frames that are taken, in order.

    sharpness, steps [n]: of `measure`. Where the camera stands still, pieces are equal
    in time.
    """
    count = len(steps)
    if count == 1:
        return [0]
    path = np.cumsum(steps) - steps[0]
    pieces = round(path[-1] / STEP_WIDTHS)
    pieces = min(max(pieces, LEAST_FRAMES), MOST_FRAMES, count)
    if path[-1] < 1e-6:
        path = np.arange(count, dtype=np.float64)
    piece = np.minimum((path / path[-1] * pieces).astype(int), pieces - 1)
    # What moves fast may leave a piece empty.
    return [
        int(places[np.argmax(sharpness[places])])
        for places in (np.flatnonzero(piece == k) for k in range(pieces))
        if len(places)
    ]


def frame_count(path):
    """The number of frames by a film's own header; 0 where it has none."""
    film = cv2.VideoCapture(str(path))
    try:
        return max(int(film.get(cv2.CAP_PROP_FRAME_COUNT)), 0)
    finally:
        film.release()


def frames(path, doing):
    """(number, frame [h, w, 3] BGR), turned upright, of those that are looked at."""
    film = cv2.VideoCapture(str(path))
    try:
        if not film.isOpened():
            raise ValueError(f"cannot decode {path}: no film that OpenCV knows")
        total = frame_count(path)
        every = max(1, -(-total // MOST_LOOKED_AT))
        # Of a film that does not tell, time alone lets a line be shown.
        bar = progress.Progress(f"{doing} {path.name}", total or 10**9, unit="frame")
        number = 0
        while film.grab():
            if number % every == 0:
                there, frame = film.retrieve()
                if not there:
                    break
                yield number, frame
            number += 1
            bar.advance()
        bar.close()
    finally:
        film.release()
