"""Detail by octaves: what a smaller size, a blur and noise take or add."""

import cv2
import numpy as np
import pytest

from alignerf.metrics import spectrum

PHOTO = np.random.default_rng(0).integers(0, 256, (128, 96, 3), np.uint8)


def test_the_photo_has_all_of_its_own():
    np.testing.assert_allclose(spectrum.octaves(PHOTO, PHOTO), 1.0)


def test_half_the_size_ends_an_octave_early():
    small = cv2.resize(PHOTO, (48, 64), interpolation=cv2.INTER_AREA)
    render = cv2.resize(small, (96, 128), interpolation=cv2.INTER_CUBIC)
    found = spectrum.octaves(PHOTO, render)
    assert found[0] < 0.4 < 0.8 < found[2] < 1.1
    assert found[0] < found[1] < found[2]


def test_a_blur_takes_the_fine_octaves_first():
    found = spectrum.octaves(PHOTO, cv2.GaussianBlur(PHOTO, (0, 0), 2.0))
    assert (np.diff(found) > 0).all()
    assert found[0] < 0.05


def test_opposite_borders_that_differ_are_no_detail():
    """A ramp has no fine octave, though its right border does not meet its left one."""
    ramp = np.tile(np.linspace(0, 255, 96), (128, 1))
    faded = spectrum.power(ramp)
    y, x = np.fft.fftfreq(128)[:, None], np.fft.fftfreq(96)
    fine = np.hypot(y, x) > 0.25
    assert faded[fine].sum() < 1e-6 * faded.sum()


@pytest.mark.parametrize("level", [0, 255])
def test_without_detail_there_is_no_ratio(level):
    flat = np.full_like(PHOTO, level)
    assert np.isnan(spectrum.octaves(flat, PHOTO)).all()
    np.testing.assert_allclose(spectrum.octaves(PHOTO, flat), 0.0, atol=1e-9)


def test_the_smallest_pictures():
    """Of 32 px the coarsest octave has a wave or two, of one pixel none."""
    tiny = PHOTO[:32, :33]
    assert np.isfinite(spectrum.octaves(tiny, tiny)).all()
    assert np.isnan(spectrum.octaves(PHOTO[:1, :1], PHOTO[:1, :1])).all()
