"""Frames of a video: sharp ones, far enough from one another and near enough.

The path of the camera is measured in widths of the picture, by optical flow between
frames that follow one another. It is cut into equal pieces, and of each the sharpest
frame is taken.
"""

import contextlib
import itertools
import logging
import os
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float

from alignerf.io import faults, images, progress
from alignerf.scenes import photos, prepare, prepared

log = logging.getLogger(__name__)

# Of a video that is none we say so.
cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_ERROR)

SUFFIXES = frozenset([".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm"])
# A piece of the path: views that overlap by nine tenths match well.
STEP_WIDTHS = 0.1
MIN_FRAMES, MAX_FRAMES = 20, 120
# Measured at this width, and at no other heights: under 32 px OpenCV's flow ends the
# process.
SMALL_PX, MIN_SMALL_PX, MAX_SMALL_PX = 192, 32, 768
# A video with fewer of its frames than this share is cut short.
TRUNCATED = 0.9
# Frames that are looked at; of longer videos evenly spaced ones.
MAX_LOOKED_AT = 3000
# Ten days at 120 a second: a head that says more is wrong.
MAX_FRAMES_TOLD = 10**8
# How files begin: the types of QuickTime's first part, and Matroska's number.
OF_QUICKTIME = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot", b"styp")
MATROSKA = b"\x1a\x45\xdf\xa3"


def is_taken(path):
    """Whether a file is a photo or a film, by its name."""
    suffixes = photos.SUFFIXES | SUFFIXES
    return path.suffix.lower() in suffixes and not path.name.startswith(".")


def find(folder):
    """Paths of the videos in a folder, sorted; a video's own path is that alone."""
    if not Path(folder).is_dir():
        video = Path(folder).is_file() and Path(folder).suffix.lower() in SUFFIXES
        return [Path(folder)] if video else []
    return sorted(
        path
        for path in Path(folder).iterdir()
        if path.suffix.lower() in SUFFIXES
        and path.is_file()
        and not path.name.startswith(".")
    )


def without_live_photos(videos, paths):
    """The videos without live photos, the seconds around a photo of the same name."""
    stems = {path.stem for path in paths}
    live = [video.name for video in videos if video.stem in stems]
    if live:
        named = faults.some_names(live)
        log.warning("left out %s: a photo of that name is there", named)
    kept = [video for video in videos if video.stem not in stems]
    for first, second in itertools.pairwise(kept):
        if first.stem == second.stem:
            raise ValueError(f"{first} and {second.name} would give the same views")
    return kept


def extract(path, folder):
    """Write a video's chosen frames to <folder>/<video>_<frame>.png; returns the paths.

    Raises ValueError naming the video where it cannot be decoded, or where its frames
    are too small or too large.
    """
    told = check(path)
    try:
        seen = measure(path, told)
    # Of damaged frames that OpenCV hands out all the same.
    except cv2.error as error:
        raise ValueError(f"cannot decode {path}: {error.err}") from None
    if seen.count < TRUNCATED * told:
        log.warning("%s: ends after %d of %d frames", path, seen.count, told)
    wanted = {seen.numbers[i] for i in choose(seen.sharpness, seen.steps)}
    log.info("%s: %d of %d frames", path.name, len(wanted), seen.count)
    written = []
    for number, frame in frames(path, "frames", seen.count, wanted.__contains__):
        if frame is not None:
            written.append(Path(folder) / f"{path.stem}_{number:06d}.png")
            images.write(written[-1], cv2.cvtColor(frame, cv2.COLOR_BGR2RGB))
    return written


def check(path):
    """How many frames a video has by its head, 0 where that does not say.

    Nothing is decoded. Raises ValueError naming the video for one that cannot be read,
    and for frames that no photo of a scene may be as small or as large as.
    """
    with opened(path) as video:
        size = [
            video.get(p) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
        ]
        check_size(path, *size)
        told = video.get(cv2.CAP_PROP_FRAME_COUNT)
    return int(told) if 0 < told < MAX_FRAMES_TOLD else 0


def check_size(path, width, height):
    """ValueError for a video's frames of such a size in px."""
    named = f"{path}: a video of {width:.0f}x{height:.0f} pixels"
    if min(width, height) < prepare.MIN_SIZE_PX:
        raise ValueError(f"{named}: no side may be under {prepare.MIN_SIZE_PX}")
    most = photos.MAX_PIXELS
    if max(width, height) > prepared.MAX_SIDE_PX or width * height > most:
        raise ValueError(f"{named}: over {most / 1e6:.0f} million pixels")


class Seen(NamedTuple):
    """The frames of a video that were looked at."""

    numbers: list[int]
    sharpness: Float[np.ndarray, " n"]
    steps: Float[np.ndarray, " n"]
    """The camera's path since the frame before, in widths."""
    count: int
    """Of all frames that are there."""


def measure(path, told) -> Seen:
    """Look at frames; told: how many there are, 0 where the video does not say.

    A video that has many more or fewer than it says is looked at twice.
    """
    flow_of = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST)
    numbers, sharpness, steps, before, count = [], [], [], None, 0
    every = stride(told)
    for number, frame in frames(path, "video", told, lambda n: n % every == 0):
        count = number + 1
        if frame is None:
            continue
        if len(numbers) == 2 * MAX_LOOKED_AT:
            return measure(path, count_frames(path))
        grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
        # Frames of one video may differ in size.
        small = cv2.resize(
            grey,
            small_size(grey if before is None else before),
            interpolation=cv2.INTER_AREA,
        )
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
    if stride(count) < every:
        return measure(path, count)
    return Seen(numbers, np.array(sharpness), np.array(steps), count)


def small_size(grey):
    """(width, height) that a frame is measured at; one of an odd shape is squeezed."""
    height = round(SMALL_PX * grey.shape[0] / grey.shape[1])
    return SMALL_PX, min(max(height, MIN_SMALL_PX), MAX_SMALL_PX)


def stride(total):
    """Every how manieth frame is looked at."""
    return max(1, -(-total // MAX_LOOKED_AT))


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
    pieces = min(max(pieces, MIN_FRAMES), MAX_FRAMES, count)
    if path[-1] < 1e-6:
        path = np.arange(count, dtype=np.float64)
    piece = np.minimum((path / path[-1] * pieces).astype(int), pieces - 1)
    # What moves fast may leave a piece empty.
    return [
        int(places[np.argmax(sharpness[places])])
        for places in (np.flatnonzero(piece == k) for k in range(pieces))
        if len(places)
    ]


def count_frames(path):
    """The number of frames that a video holds, whatever it says."""
    return sum(1 for _ in frames(path, "counting", 0, lambda number: False))


def frames(path, doing, total, is_wanted):
    """(number, frame [h, w, 3] BGR) turned upright; None for those not wanted.

    total: how many there may be, 0 where that is unknown. is_wanted: of a number.
    """
    # Of a video that does not tell, time alone lets a line be shown.
    bar = progress.Progress(f"{doing} {path.name}", total or 10**9, unit="frame")
    with opened(path) as video:
        for number in itertools.count():
            if not video.grab():
                break
            frame = None
            if is_wanted(number):
                there, frame = video.retrieve()
                if not there:
                    break
                check_size(path, *frame.shape[1::-1])
            yield number, frame
            bar.advance()
    bar.close()


@contextlib.contextmanager
def opened(path):
    """OpenCV's reader of a video; ValueError naming it where it is none."""
    with faults.opened(path) as file:
        head = file.read(12)
    # FFmpeg would follow what a list of other files names, which may be anywhere.
    is_known = head[4:8] in OF_QUICKTIME or head[:4] in (b"RIFF", MATROSKA)
    # FFmpeg asks for its level at the first video; an import changes no variable.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    # Another reader takes a % in a name for the numbers of many files.
    video = cv2.VideoCapture()
    try:
        if not (is_known and video.open(os.path.abspath(path), cv2.CAP_FFMPEG)):
            raise ValueError(f"cannot decode {path}: no video that OpenCV can read")
        yield video
    finally:
        video.release()
