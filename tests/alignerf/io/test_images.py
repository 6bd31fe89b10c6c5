"""The one reader and the one writer of the pipeline's PNGs."""

import os

import cv2
import numpy as np
import pytest
from PIL import Image

from alignerf.io import images

KINDS = {
    "grey": ((9, 9), np.uint8),
    "with alpha": ((9, 9, 4), np.uint8),
    "of 16 bits": ((9, 9, 3), np.uint16),
}


@pytest.fixture
def image(rng):
    return rng.integers(0, 256, (41, 37, 3), dtype=np.uint8)


def test_every_pixel_comes_back_and_red_is_red(tmp_path, image):
    image[0, 0] = (255, 0, 0)
    path = tmp_path / "deep" / "a b.png"
    images.write(path, image)
    assert os.listdir(path.parent) == ["a b.png"]
    found = images.read(path)
    assert found.dtype == np.uint8
    np.testing.assert_array_equal(found, image)
    found[:] = 0
    np.testing.assert_array_equal(cv2.imread(str(path))[..., ::-1], image)


def test_other_writers_are_read_alike(tmp_path, image):
    Image.fromarray(image).save(tmp_path / "pillow.png", optimize=True)
    cv2.imwrite(str(tmp_path / "opencv.png"), image[..., ::-1])
    for path in tmp_path.iterdir():
        np.testing.assert_array_equal(images.read(path), image)


@pytest.mark.parametrize("kind", KINDS)
def test_images_of_another_kind_are_refused_by_name(tmp_path, rng, kind):
    path = tmp_path / "a.png"
    shape, dtype = KINDS[kind]
    other = rng.integers(0, 256, shape).astype(dtype)
    cv2.imwrite(str(path), other)
    for call in (images.read, images.check):
        with pytest.raises(ValueError, match=r"a\.png: not an 8-bit RGB PNG"):
            call(path)
    with pytest.raises(ValueError, match=r"b\.png: an image must be uint8 \[h, w, 3\]"):
        images.write(tmp_path / "b.png", other)
    assert not (tmp_path / "b.png").exists()


@pytest.mark.parametrize("kind", ["JPEG", "TIFF", "GIF"])
def test_other_files_of_that_name_are_refused(tmp_path, image, kind):
    Image.fromarray(image).save(tmp_path / "a.png", format=kind)
    with pytest.raises(ValueError, match=r"cannot decode .*a\.png"):
        images.read(tmp_path / "a.png")


def test_another_size_is_refused(tmp_path, image):
    path = tmp_path / "a.png"
    images.write(path, image)
    np.testing.assert_array_equal(images.read(path, size=(37, 41)), image)
    images.check(path, size=(37, 41))
    for call in (images.read, images.check):
        with pytest.raises(ValueError, match=r"a\.png: 37x41 pixels, not 41x37"):
            call(path, size=(41, 37))


def test_files_cut_or_altered_anywhere_are_refused_by_name(tmp_path, image, rng):
    path = tmp_path / "a.png"
    with pytest.raises(ValueError, match=r"a\.png: not found"):
        images.read(path)
    images.write(path, image)
    whole = path.read_bytes()
    cuts = [0, 5, 25, 60, *rng.integers(0, len(whole) - 20, 40)]
    flips = [*range(60), *rng.integers(0, len(whole), 200)]
    damaged = [whole[:cut] for cut in cuts]
    damaged += [
        whole[:at] + bytes([whole[at] ^ 0x55]) + whole[at + 1 :] for at in flips
    ]
    refused = 0
    for content in damaged:
        path.write_bytes(content)
        try:
            found = images.read(path)
        except ValueError as error:
            assert "a.png: " in str(error)  # noqa: PT017
            refused += 1
        else:
            # What ends a file is not looked at.
            np.testing.assert_array_equal(found, image)
    assert refused >= len(damaged) - 10
