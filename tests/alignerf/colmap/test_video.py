"""Frames of a film: how many, and that they are sharp and evenly spread."""

import logging
import os
import struct
import subprocess
import sys

import cv2
import numpy as np
import pytest

from alignerf.colmap import video
from alignerf.io import images
from alignerf.scenes import photos


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """A camera that slides over a texture for 60 frames; every third is blurred."""
    rng = np.random.default_rng(0)
    coarse = rng.integers(0, 256, (30, 160, 3), dtype=np.uint8)
    world = cv2.resize(coarse, (1600, 300), interpolation=cv2.INTER_CUBIC)
    path = tmp_path_factory.mktemp("film") / "a walk.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 30, (320, 240))
    for k in range(60):
        frame = world[30:270, 8 * k : 8 * k + 320]
        if k % 3:
            frame = cv2.GaussianBlur(frame, (0, 0), 3.0)
        writer.write(np.ascontiguousarray(frame))
    writer.release()
    return path


def test_the_path_is_measured_in_widths(film):
    numbers, sharpness, steps, count = video.measure(film, 60)
    assert count == 60
    assert numbers == list(range(60))
    # 8 px of 320 a frame.
    assert steps[0] == 0
    assert np.median(steps[1:]) == pytest.approx(0.025, rel=0.1)
    assert sharpness[::3].min() > sharpness[1::3].max()


def test_sharp_frames_are_written_under_the_films_name(film, tmp_path):
    paths = video.extract(film, tmp_path)
    numbers = [int(path.stem.rpartition("_")[2]) for path in paths]
    # 1.5 widths would be 15 pieces; so few are made 20.
    assert len(paths) == video.MIN_FRAMES
    assert paths[0].name == "a walk_000000.png"
    assert numbers == sorted(set(numbers))
    assert np.mean([number % 3 == 0 for number in numbers]) > 0.8
    assert images.read(paths[3]).shape == (240, 320, 3)
    assert np.diff(numbers).max() <= 6


def test_pieces_are_equal_on_the_path_and_not_in_time():
    steps = np.array([0.0] + [0.0] * 100 + [0.1] * 40)
    sharpness = np.random.default_rng(0).uniform(size=141)
    chosen = video.choose(sharpness, steps)
    # 4 widths are 40 pieces: where the camera stood still, one frame is enough.
    assert 36 <= len(chosen) <= 40
    assert sum(place <= 101 for place in chosen) <= 2


def test_a_camera_that_stands_still_gives_frames_evenly_in_time():
    chosen = video.choose(np.zeros(200), np.zeros(200))
    assert chosen == [10 * k for k in range(video.MIN_FRAMES)]


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_film_of_few_frames_gives_them_all(count):
    chosen = video.choose(np.ones(count), np.full(count, 0.05))
    assert chosen == list(range(count))


def test_many_widths_are_no_more_than_the_most():
    chosen = video.choose(np.ones(9999), np.full(9999, 0.1))
    assert len(chosen) == video.MAX_FRAMES


@pytest.mark.parametrize("head", [b"no film at all", b"\0\0\0\x18ftypmp42", b""])
def test_a_film_that_is_none_is_named(root, tmp_path, head):
    """In one line, in a process that reads no other: OpenCV and FFmpeg are silent."""
    (tmp_path / "broken.mp4").write_bytes(head + bytes(500))
    code = """
from pathlib import Path
from alignerf.io import faults
from alignerf.colmap import video
faults.run(lambda: video.extract(Path("broken.mp4"), Path()))
"""
    words = [sys.executable, "-c", code]
    clean = {k: v for k, v in os.environ.items() if k != "OPENCV_FFMPEG_LOGLEVEL"}
    clean["PYTHONPATH"] = str(root)
    done = subprocess.run(
        words, cwd=tmp_path, env=clean, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert done.stderr.startswith("error: cannot decode broken.mp4")


def test_films_are_found_beside_photos_or_alone(tmp_path, film):
    assert video.find(film) == [film]
    assert video.find(film.parent) == [film]
    assert video.find(tmp_path) == []
    (tmp_path / ".hidden.mp4").write_bytes(b"")
    assert video.find(tmp_path) == []


def write_film(path, sizes):
    """Write an AVI of a frame of noise for each (width, height); they are equal."""
    rng = np.random.default_rng(0)
    fourcc = cv2.VideoWriter_fourcc(*"MJPG")
    writer = cv2.VideoWriter(str(path), fourcc, 30, sizes[0])
    for width, height in sizes:
        writer.write(rng.integers(0, 256, (height, width, 3), dtype=np.uint8))
    writer.release()
    return path


@pytest.mark.parametrize("size", [(800, 64), (640, 34), (34, 640), (40, 4000)])
def test_films_of_odd_shapes_become_frames(tmp_path, size):
    film = write_film(tmp_path / "wide.avi", [size] * 4)
    (tmp_path / "frames").mkdir()
    # One of four pieces of its path may be empty.
    assert len(video.extract(film, tmp_path / "frames")) >= 3


@pytest.mark.parametrize("size", [(200, 16), (4, 200), (32768, 32), (200, 100)])
def test_frames_too_small_or_too_large_are_refused_by_the_head(
    tmp_path, monkeypatch, size
):
    monkeypatch.setattr(video, "frames", None)
    monkeypatch.setattr(photos, "MAX_PIXELS", 15_000)
    film = write_film(tmp_path / "a.avi", [size] * 2)
    with pytest.raises(
        ValueError, match=rf"a\.avi: a video of {size[0]}x{size[1]} pix"
    ):
        video.extract(film, tmp_path)


def test_a_frame_larger_than_the_head_says_is_refused(tmp_path, monkeypatch):
    film = write_film(tmp_path / "a.avi", [(200, 100)] * 2)
    monkeypatch.setattr(photos, "MAX_PIXELS", 15_000)
    with pytest.raises(ValueError, match=r"a\.avi: a video of 200x100 pixels: over"):
        list(video.frames(film, "film", 2, lambda number: True))


def told(film, count):
    """Let an AVI's head tell another number of frames."""
    content = bytearray(film.read_bytes())
    struct.pack_into("<I", content, content.index(b"avih") + 8 + 16, count)
    struct.pack_into("<I", content, content.index(b"strh") + 8 + 32, count)
    film.write_bytes(content)
    return film


@pytest.mark.parametrize("count", [0, 1, 40, 3000, 2**31 - 1, 2**32 - 1])
def test_a_head_that_lies_about_frames_loses_none(tmp_path, monkeypatch, count):
    film = told(write_film(tmp_path / "a.avi", [(64, 48)] * 40), count)
    every = video.measure(film, video.check(film))
    assert every.count == 40
    assert every.numbers == list(range(40))
    monkeypatch.setattr(video, "MAX_LOOKED_AT", 10)
    fewer = video.measure(film, video.check(film))
    assert fewer.count == 40
    assert fewer.numbers == list(range(0, 40, 4))


def test_a_name_with_a_pattern_in_it_is_one_film(tmp_path):
    film = write_film(tmp_path / "a%03d.avi", [(64, 48)] * 3)
    write_film(tmp_path / "a001.avi", [(96, 64)] * 9)
    (tmp_path / "frames").mkdir()
    paths = video.extract(film, tmp_path / "frames")
    assert [path.name for path in paths] == [f"a%03d_{k:06d}.png" for k in range(3)]
    assert images.read(paths[0]).shape == (48, 64, 3)


def test_a_name_like_an_address_is_one_film(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (film,) = video.find(write_film(tmp_path / "concat:a.avi", [(64, 48)] * 2).parent)
    assert video.check(film.relative_to(tmp_path)) == 2


LISTS = {
    "m3u8": "#EXTM3U\n#EXT-X-TARGETDURATION:9\n#EXTINF:9,\n{}\n#EXT-X-ENDLIST\n",
    "concat": "ffconcat version 1.0\nfile {}\n",
}


@pytest.mark.parametrize("form", LISTS.values(), ids=LISTS)
def test_a_list_of_other_files_is_no_film(tmp_path, form):
    other = write_film(tmp_path / "other.avi", [(64, 48)] * 3)
    (tmp_path / "a.mp4").write_text(form.format(other.name))
    with pytest.raises(ValueError, match=r"a\.mp4: no video"):
        video.extract(tmp_path / "a.mp4", tmp_path)


def test_frames_that_change_their_size_are_named_or_taken(tmp_path, monkeypatch):
    film = write_film(tmp_path / "a.avi", [(64, 48)] * 2)
    sizes = [(48, 64, 3), (64, 48, 3), (48, 64, 3)]

    def frames(path, doing, total, is_wanted):
        for number, size in enumerate(sizes):
            yield number, np.full(size, 9 * number, np.uint8)

    monkeypatch.setattr(video, "frames", frames)
    (tmp_path / "frames").mkdir()
    assert len(video.extract(film, tmp_path / "frames")) == 3


def test_a_film_cut_short_says_so(tmp_path, caplog):
    film = told(write_film(tmp_path / "a.avi", [(64, 48)] * 10), 100)
    (tmp_path / "frames").mkdir()
    with caplog.at_level(logging.WARNING):
        assert len(video.extract(film, tmp_path / "frames")) == 10
    assert "ends after 10 of 100 frames" in caplog.text
