"""COLMAP models, wherever and however they lie: what is taken, and what is missing."""

import numpy as np
import pytest

from alignerf.readers import projects
from tests import app_cases as cases

NAMES = [f"p{i}" for i in range(4)]


def write_photos(folder, names=NAMES):
    for name in names:
        cases.write_photo(folder / f"{name}.jpg")


@pytest.fixture
def given(rng):
    return cases.camtoworlds(rng, 4)


@pytest.mark.parametrize("as_text", [False, True])
@pytest.mark.parametrize(
    "place", ["sparse/0", "sparse", "colmap/sparse/0", "colmap/sparse", ".", "sparse/3"]
)
def test_a_model_is_found_at_its_usual_places(tmp_path, given, place, as_text):
    cases.write_model(tmp_path / place, NAMES, given, as_text=as_text)
    write_photos(tmp_path / "images")
    views, left_out = projects.read(tmp_path)
    assert (views.names, left_out) == (NAMES, [])
    np.testing.assert_allclose(views.camtoworlds, given, atol=1e-9)
    fx, fy, cx, cy = cases.LENS
    wanted = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
    np.testing.assert_allclose(np.linalg.inv(views.pixtocams[1]), wanted, atol=1e-9)
    np.testing.assert_array_equal(views.points[0], [[1, 1, 1]])


@pytest.mark.parametrize(
    ("part", "named"),
    [("cameras", "model without cameras.txt"), ("images", "model without images.txt")],
)
def test_half_a_model_says_what_is_missing(tmp_path, given, part, named):
    cases.write_model(tmp_path / "sparse", NAMES, given, as_text=True)
    write_photos(tmp_path / "images")
    (tmp_path / f"sparse/{part}.txt").unlink()
    with pytest.raises(ValueError, match=named):
        projects.read(tmp_path)


def spoiled(line):
    return lambda text: text.replace(text.splitlines()[4], line, 1)


IMAGE = "1 {} 0 0 0 1 p0.jpg"


@pytest.mark.parametrize(
    ("spoil", "named"),
    [
        (spoiled(IMAGE.format("0 0 0 0")), r"rotation of 'p0\.jpg' is none"),
        (spoiled(IMAGE.format("nan 0 0 0")), "line 5: 7 numbers were expected"),
        (spoiled(IMAGE.format("1 0 x 0")), "line 5: 7 numbers were expected"),
        (spoiled(IMAGE.format("1e299 0 0 0")), r"rotation of 'p0\.jpg' is scaled"),
        (spoiled("1 1 0 0 0"), "line 5: not an image: cut short"),
        # No lines of points: COLMAP would leave out every second image.
        (lambda text: text.replace("\n\n", "\n"), "not the points of the image above"),
        (lambda text: text.replace("1 p0.jpg", "7 p0.jpg"), r"p0\.jpg: no camera 7"),
    ],
)
def test_a_text_that_colmap_would_misread_is_refused(tmp_path, given, spoil, named):
    cases.write_model(tmp_path / "sparse/0", NAMES, given, as_text=True)
    write_photos(tmp_path / "images")
    path = tmp_path / "sparse/0/images.txt"
    text = path.read_text()
    assert text.splitlines()[4].endswith("p0.jpg")
    path.write_text(spoil(text))
    with pytest.raises(ValueError, match=named) as raised:
        projects.read(tmp_path)
    assert "sparse/0" in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("name", ["cameras.txt", "images.txt", "points3D.txt"])
def test_a_byte_order_mark_does_not_count_and_no_utf_8_is_named(tmp_path, given, name):
    cases.write_model(tmp_path / "sparse/0", NAMES, given, as_text=True)
    write_photos(tmp_path / "images")
    expected = projects.read(tmp_path)[0].camtoworlds
    path = tmp_path / "sparse/0" / name
    text = path.read_text()
    path.write_text(text, encoding="utf-8-sig")
    np.testing.assert_array_equal(projects.read(tmp_path)[0].camtoworlds, expected)
    path.write_text(text, encoding="utf-16")
    with pytest.raises(ValueError, match=rf"{name}: not UTF-8"):
        projects.read(tmp_path)


def test_a_binary_quaternion_of_0_is_refused(tmp_path, given):
    cases.write_model(tmp_path / "sparse/0", NAMES, given)
    write_photos(tmp_path / "images")
    path = tmp_path / "sparse/0/images.bin"
    content = bytearray(path.read_bytes())
    content[12:44] = bytes(32)
    path.write_bytes(content)
    with pytest.raises(
        ValueError, match=r"images\.bin: the rotation of 'p0\.jpg' is none"
    ):
        projects.read(tmp_path)


@pytest.mark.parametrize("as_text", [False, True])
@pytest.mark.parametrize("times", [1.03, 0.97, 2.5])
def test_quaternions_of_another_length_are_no_other_turn(
    tmp_path, given, as_text, times, caplog
):
    """COLMAP's reader would shear by them."""
    cases.write_model(tmp_path / "sparse/0", NAMES, given, as_text=as_text)
    write_photos(tmp_path / "images")
    if as_text:
        path = tmp_path / "sparse/0/images.txt"
        lines = [line.split() for line in path.read_text().splitlines()]
        for words in lines:
            if len(words) > 8 and words[0] != "#":
                words[1:5] = (repr(times * float(word)) for word in words[1:5])
        path.write_text("\n".join(map(" ".join, lines)) + "\n")
    else:
        path = tmp_path / "sparse/0/images.bin"
        content = bytearray(path.read_bytes())
        for at in range(12, len(content), 79):
            turn = times * np.frombuffer(content, "<f8", 4, at)
            content[at : at + 32] = turn.tobytes()
        path.write_bytes(content)
    if times == 2.5:
        with pytest.raises(ValueError, match=r"images\..*are scaled by 2.5: divide"):
            projects.read(tmp_path)
        return
    views, _ = projects.read(tmp_path)
    np.testing.assert_allclose(views.camtoworlds, given, atol=1e-9)
    assert "by 3 %: the nearest are taken" in caplog.text


def test_both_kinds_of_files_are_read_as_colmap_reads_them(tmp_path, given):
    """Its binary ones come first; a broken text beside them does not count."""
    cases.write_model(tmp_path / "sparse/0", NAMES, given)
    (tmp_path / "sparse/0/images.txt").write_text("x\n")
    write_photos(tmp_path / "images")
    assert projects.read(tmp_path)[0].names == NAMES
