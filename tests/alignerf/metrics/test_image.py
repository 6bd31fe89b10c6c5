"""Metrics: PSNR, SSIM against the formula, masks and extremes."""

import numpy as np
import pytest
from scipy import ndimage

from alignerf.metrics import image as image_metrics


@pytest.fixture
def pair(rng):
    target = rng.integers(0, 256, (30, 40, 3)).astype(np.uint8)
    noise = rng.integers(-20, 20, target.shape)
    return target, np.clip(target + noise, 0, 255).astype(np.uint8)


def everywhere(image):
    return np.ones(image.shape[:2], bool)


def test_psnr_is_the_formula(pair):
    target, render = pair
    mse = np.mean((target / 255.0 - render / 255.0) ** 2)
    found = image_metrics.psnr_db(target, render, everywhere(target))
    assert found == pytest.approx(10 * np.log10(1 / mse))


def test_psnr_of_identical_images_is_infinite(pair):
    assert image_metrics.psnr_db(pair[0], pair[0], everywhere(pair[0])) == np.inf


def test_invalid_pixels_do_not_count(pair):
    target, render = pair
    valid = everywhere(target)
    valid[:, 25:] = False
    spoilt = np.where(valid[..., None], target, 0).astype(np.uint8)
    for metric in (image_metrics.psnr_db, image_metrics.ssim):
        assert metric(target, render, valid) == metric(spoilt, render, valid)
    cut = image_metrics.psnr_db(
        target[:, :25], render[:, :25], everywhere(target[:, :25])
    )
    assert image_metrics.psnr_db(target, render, valid) == pytest.approx(cut)


def ssim_twin(target, render):
    """Wang et al. 2004 in float64: 11 x 11 Gaussian window, valid region."""
    x = np.arange(-5, 6)
    window = np.exp(-(x**2) / (2 * 1.5**2))
    window = np.outer(window, window) / np.outer(window, window).sum()

    def mean(image):
        blurred = [ndimage.correlate(image[..., c], window) for c in range(3)]
        return np.stack(blurred, axis=-1)[5:-5, 5:-5]

    a, b = target / 255.0, render / 255.0
    ma, mb = mean(a), mean(b)
    va, vb, vab = mean(a * a) - ma**2, mean(b * b) - mb**2, mean(a * b) - ma * mb
    c1, c2 = 0.01**2, 0.03**2
    numerator = (2 * ma * mb + c1) * (2 * vab + c2)
    return (numerator / ((ma**2 + mb**2 + c1) * (va + vb + c2))).mean()


def test_ssim_is_the_formula(pair):
    found = image_metrics.ssim(*pair, everywhere(pair[0]))
    assert found == pytest.approx(ssim_twin(*pair), abs=1e-6)


def test_small_or_masked_images_are_refused(pair):
    small = np.zeros((10, 30, 3), np.uint8)
    with pytest.raises(ValueError, match="under 11"):
        image_metrics.ssim(small, small, everywhere(small))
    nothing = ~everywhere(pair[0])
    for metric in (image_metrics.psnr_db, image_metrics.ssim):
        with pytest.raises(ValueError, match="no valid pixel"):
            metric(*pair, nothing)


@pytest.mark.parametrize("angle", [0, 30, 45, 90, 135, 160])
def test_a_smear_in_any_direction_takes_detail(rng, angle):
    """All directions together keep 0.7 of it."""
    photo = ndimage.gaussian_filter(rng.uniform(0, 255, (80, 90, 3)), (0.8, 0.8, 0))
    along = np.linspace(-2.5, 2.5, 41)
    turn = np.deg2rad(angle)
    smeared = np.mean(
        [
            ndimage.shift(
                photo, (a * np.sin(turn), a * np.cos(turn), 0), order=1, mode="nearest"
            )
            for a in along
        ],
        axis=0,
    ).astype(np.uint8)
    photo = photo.astype(np.uint8)
    assert image_metrics.least_detail(photo, photo) == 1
    assert image_metrics.least_detail(smeared, photo) < 0.5
    assert image_metrics.least_detail(photo // 2, photo) == pytest.approx(0.5, abs=0.05)
    assert image_metrics.least_detail(photo, np.zeros_like(photo)) > 100
