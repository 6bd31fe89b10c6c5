"""A film as WebM (VP8), which all browsers play: frames side by side, with labels.

VP9 would make files a sixth smaller, and takes four times as long to write.
"""

import contextlib
import os

import cv2
import numpy as np

from alignerf.files import atomic

CODEC = "VP80"
# Sides of less are enlarged, for labels that can be read; between sides is a line.
LEAST_WIDTH_PX, GAP_PX, LABEL_PX = 400, 4, 32
FONT, FONT_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.6
GROUND, INK = (24, 24, 24), (240, 240, 240)
MOST_LETTERS = 40


def write(path, frames, fps, labels):
    """Write a film; frames: of each moment the images [h, w, 3] uint8 of all labels.

    Raises ValueError where OpenCV cannot write it, or has not written all of it.
    """
    with atomic.replace_file(path) as temporary:
        writer, count = None, 0
        for images in frames:
            picture = side_by_side(images, labels)
            if writer is None:
                writer = opened(temporary, path, fps, picture)
            writer.write(picture[..., ::-1])
            count += 1
        if writer is None:
            raise ValueError(f"{path}: a film without frames")
        writer.release()
        if (written := count_frames(temporary)) != count:
            raise ValueError(f"{path}: {written} of {count} frames could be written")


def opened(temporary, path, fps, picture):
    """OpenCV's writer of a film of such pictures."""
    height, width = picture.shape[:2]
    code = cv2.VideoWriter_fourcc(*CODEC)
    with quiet_stderr():
        writer = cv2.VideoWriter(
            str(temporary), cv2.CAP_FFMPEG, code, fps, (width, height)
        )
    if not writer.isOpened():
        raise ValueError(f"{path}: OpenCV cannot write a WebM film here")
    return writer


@contextlib.contextmanager
def quiet_stderr():
    """Without what native code writes on stderr.

    OpenCV warns of every WebM that the name of its codec is not one of AVI's.
    """
    kept, nothing = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nothing, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nothing)


def count_frames(path):
    """Frames that can be read of a film."""
    reader, count = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG), 0
    while reader.grab():
        count += 1
    reader.release()
    return count


def side_by_side(images, labels):
    """One image of several, each below its label; its sides are even."""
    parts = []
    for image, label in zip(images, labels, strict=True):
        image = enlarged(image)
        bar = np.full((LABEL_PX, image.shape[1], 3), GROUND, np.uint8)
        place = (10, LABEL_PX - 10)
        text = label[:MOST_LETTERS]
        cv2.putText(bar, text, place, FONT, FONT_SCALE, INK, 1, cv2.LINE_AA)
        line = np.full((LABEL_PX + len(image), GAP_PX, 3), GROUND, np.uint8)
        parts += [line, np.concatenate([bar, image])]
    whole = np.concatenate(parts[1:], axis=1)
    odd = [(0, side % 2) for side in whole.shape[:2]]
    return np.pad(whole, [*odd, (0, 0)], "edge")


def enlarged(image):
    """An image at least LEAST_WIDTH_PX wide, with the proportions that it has."""
    height, width = image.shape[:2]
    if width >= LEAST_WIDTH_PX:
        return image
    size = LEAST_WIDTH_PX, max(1, round(height * LEAST_WIDTH_PX / width))
    return cv2.resize(image, size, interpolation=cv2.INTER_CUBIC)
