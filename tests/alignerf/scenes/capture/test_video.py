"""Frames of a film: how many, and that they are sharp and evenly spread."""

import cv2
import numpy as np
import pytest

from alignerf.files import images
from alignerf.scenes.capture import video


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
    numbers, sharpness, steps = video.measure(film)
    assert numbers == list(range(60))
    # 8 px of 320 a frame.
    assert steps[0] == 0
    assert np.median(steps[1:]) == pytest.approx(0.025, rel=0.1)
    assert sharpness[::3].min() > sharpness[1::3].max()


def test_sharp_frames_are_written_under_the_films_name(film, tmp_path):
    paths = video.extract(film, tmp_path)
    numbers = [int(path.stem.rpartition("_")[2]) for path in paths]
    # 1.5 widths would be 15 pieces; so few are made 20.
    assert len(paths) == video.LEAST_FRAMES
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
    assert chosen == [10 * k for k in range(video.LEAST_FRAMES)]


@pytest.mark.parametrize("count", [1, 2, 5])
def test_a_film_of_few_frames_gives_them_all(count):
    chosen = video.choose(np.ones(count), np.full(count, 0.05))
    assert chosen == list(range(count))


def test_many_widths_are_no_more_than_the_most():
    chosen = video.choose(np.ones(9999), np.full(9999, 0.1))
    assert len(chosen) == video.MOST_FRAMES


def test_a_film_that_is_none_is_named(tmp_path):
    (tmp_path / "broken.mp4").write_bytes(b"no film at all" * 100)
    with pytest.raises(ValueError, match=r"cannot decode .*broken\.mp4"):
        video.extract(tmp_path / "broken.mp4", tmp_path)


def test_films_are_found_beside_photos_or_alone(tmp_path, film):
    assert video.find(film) == [film]
    assert video.find(film.parent) == [film]
    assert video.find(tmp_path) == []
    (tmp_path / ".hidden.mp4").write_bytes(b"")
    assert video.find(tmp_path) == []
