"""The film: what is shown comes back, in order, and nothing stays half written."""

import cv2
import numpy as np
import pytest

from alignerf.flythrough import film

FPS = 24


def plain(colour, width=64, height=48):
    """An image of one colour."""
    return np.full((height, width, 3), colour, np.uint8)


def read(path):
    """The frames of a film, RGB."""
    reader, found = cv2.VideoCapture(str(path)), []
    while (got := reader.read())[0]:
        found.append(got[1][..., ::-1])
    return reader.get(cv2.CAP_PROP_FPS), np.stack(found)


def test_moments_come_back_side_by_side(tmp_path):
    shown = [(40, 200), (90, 150), (140, 100), (200, 40)]
    moments = ([plain(one) for one in pair] for pair in shown)
    film.write(tmp_path / "film.webm", moments, FPS, ["before", "after"])
    fps, frames = read(tmp_path / "film.webm")
    assert fps == FPS
    assert frames.shape[0] == len(shown)
    below = frames[:, film.LABEL_PX + 20 :]
    for frame, (left, right) in zip(below, shown, strict=True):
        middle = frame.shape[1] // 2
        assert frame[:, 20 : middle - 20].mean() == pytest.approx(left, abs=4)
        assert frame[:, middle + 20 : -20].mean() == pytest.approx(right, abs=4)
    # WebM begins as every Matroska file does.
    assert (tmp_path / "film.webm").read_bytes()[:4] == b"\x1a\x45\xdf\xa3"


def test_colours_keep_their_order(tmp_path):
    film.write(tmp_path / "film.webm", [[plain((200, 60, 20))]] * 3, FPS, ["one"])
    _, frames = read(tmp_path / "film.webm")
    found = frames[:, film.LABEL_PX + 20 :].mean(axis=(0, 1, 2))
    np.testing.assert_allclose(found, (200, 60, 20), atol=6)


@pytest.mark.parametrize("size", [(64, 48), (333, 251), (480, 270), (1000, 601)])
@pytest.mark.parametrize("count", [1, 2])
def test_sides_are_even_and_wide_enough_for_labels(size, count):
    whole = film.side_by_side([plain(9, *size)] * count, ["label"] * count)
    height, width = whole.shape[:2]
    assert height % 2 == width % 2 == 0
    side = max(size[0], film.LEAST_WIDTH_PX)
    assert 0 <= width - (count * side + (count - 1) * film.GAP_PX) <= 1
    # None is stretched.
    assert abs(height - film.LABEL_PX - side * size[1] / size[0]) <= 1.5


def test_labels_are_told_apart():
    one, other = (
        film.side_by_side([plain(9)], [label]) for label in ("before", "after (x)")
    )
    assert (one[: film.LABEL_PX] != other[: film.LABEL_PX]).any()
    np.testing.assert_array_equal(one[film.LABEL_PX :], other[film.LABEL_PX :])


def test_a_film_that_fails_leaves_nothing(tmp_path, monkeypatch):
    def moments():
        yield [plain(9)]
        raise ValueError("a damaged frame")

    out = tmp_path / "film.webm"
    out.write_bytes(b"the film of before")
    with pytest.raises(ValueError, match="a damaged frame"):
        film.write(out, moments(), FPS, ["one"])
    with pytest.raises(ValueError, match=r"film\.webm: a film without frames"):
        film.write(out, [], FPS, ["one"])
    monkeypatch.setattr(film, "count_frames", lambda path: 1)
    with pytest.raises(ValueError, match=r"film\.webm: 1 of 2 frames"):
        film.write(out, [[plain(9)]] * 2, FPS, ["one"])
    monkeypatch.setattr(film, "CODEC", "none")
    with pytest.raises(ValueError, match=r"film\.webm: OpenCV cannot write"):
        film.write(out, [[plain(9)]] * 2, FPS, ["one"])
    assert [path.name for path in tmp_path.iterdir()] == ["film.webm"]
    assert out.read_bytes() == b"the film of before"


def test_opencvs_warning_of_the_codec_is_not_shown(tmp_path, capfd):
    film.write(tmp_path / "film.webm", [[plain(9)]], FPS, ["one"])
    assert capfd.readouterr().err == ""
