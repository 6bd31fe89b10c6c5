"""The controls: what they keep, what they must not earn, on pairs of known truth."""

import functools

import cv2
import numpy as np
import pytest

from flow.estimation import estimate
from flow.warping import controls, warp

HEIGHT, WIDTH = 150, 200
INNER = np.s_[8:-8, 8:-8]


def texture(seed=0):
    """Detail at all scales, as a photo has it."""
    rng = np.random.default_rng(seed)
    image = sum(
        scale * cv2.GaussianBlur(rng.normal(size=(HEIGHT, WIDTH, 3)), (0, 0), scale)
        for scale in (0.7, 1.5, 3, 6, 12)
    )
    return np.clip(127 + 45 * image / image.std(), 0, 255).astype(np.uint8)


def smooth_flow(longest_px, sigma_px, seed=0):
    random = np.random.default_rng([1, seed]).normal(size=(HEIGHT, WIDTH, 2))
    flow_px = cv2.GaussianBlur(random, (0, 0), sigma_px)
    return (flow_px * longest_px / np.linalg.norm(flow_px, axis=-1).max()).astype(
        np.float32
    )


def degrade(image, *, blur_px, noise, correlated_px=0.0, seed=0):
    """What a render does to a photo: blur, and errors of this deviation."""
    errors = np.random.default_rng([2, seed]).normal(size=image.shape)
    if correlated_px:
        errors = cv2.GaussianBlur(errors, (0, 0), correlated_px)
    errors *= noise / errors.std()
    blurred = cv2.GaussianBlur(image, (0, 0), blur_px).astype(float)
    return np.clip(np.rint(blurred + errors), 0, 255).astype(np.uint8)


def psnr_db(first, second):
    difference = first[INNER].astype(float) - second[INNER]
    return -10 * np.log10(np.square(difference).mean() / 255**2)


def gain_db(render, photo, flow_px):
    return psnr_db(warp.warp(photo, flow_px), render) - psnr_db(photo, render)


def crossfit(render, photo, *, method=estimate.DEFAULT, **options):
    photo, _ = estimate.blur_match(photo, render, method=method)
    flow_of = functools.partial(estimate.estimate, method=method)
    return controls.crossfit_flow(render, photo, flow_of=flow_of, **options)


def in_sample(render, photo, method):
    return estimate.flow_and_validity(render, photo, method=method)[0]


# `make tools` has the others, too.
SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.whole) for seed in (1, 2))]


@pytest.mark.parametrize("seed", SEEDS[:2])
@pytest.mark.parametrize(
    ("longest_px", "sigma_px", "share"), [(2, 20, 0.9), (3, 40, 0.95), (1, 30, 0.9)]
)
def test_crossfit_flow_keeps_true_smooth_alignment(longest_px, sigma_px, share, seed):
    photo, true_px = texture(seed), smooth_flow(longest_px, sigma_px, seed)
    render = degrade(warp.warp(photo, true_px), blur_px=1.25, noise=6, seed=seed)
    found_px = crossfit(render, photo)
    true_db = gain_db(render, photo, true_px)
    assert true_db > 0.3
    assert share * true_db < gain_db(render, photo, found_px) < 1.01 * true_db
    error_px = np.linalg.norm(found_px - true_px, axis=-1)[INNER].mean()
    assert error_px < 0.3 * np.linalg.norm(true_px, axis=-1)[INNER].mean()


def test_one_passage_would_lose_much_of_it():
    photo, true_px = texture(), smooth_flow(3, 40)
    render = degrade(warp.warp(photo, true_px), blur_px=1.25, noise=6)
    once, thrice = (crossfit(render, photo, passages=n) for n in (1, 3))
    assert gain_db(render, photo, once) < 0.95 * gain_db(render, photo, thrice)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize(("noise", "correlated_px"), [(12, 0.0), (12, 1.5), (20, 2.0)])
def test_noise_is_fitted_in_sample_and_not_crossfit(noise, correlated_px, seed):
    """Nothing is displaced: what a warp gains here, it gains by fitting the errors."""
    photo = texture(seed)
    render = degrade(
        photo, blur_px=1.25, noise=noise, correlated_px=correlated_px, seed=seed
    )
    # Of the estimators the one that fits errors most.
    fitted_db = gain_db(render, photo, in_sample(render, photo, "dis_fine"))
    held_db = gain_db(render, photo, crossfit(render, photo, method="dis_fine"))
    assert fitted_db > 0
    if correlated_px:
        assert fitted_db > 0.02
    assert held_db < 0


def test_crossfit_flow_has_the_direction_of_flow():
    image = texture()
    render = np.roll(image, (-2, 3), axis=(0, 1))
    found_px = crossfit(render, image)
    # render(x) is photo(x + (-3, 2)).
    np.testing.assert_allclose(
        np.median(found_px.reshape(-1, 2), axis=0), [-3, 2], atol=0.1
    )


def test_identical_images_give_exactly_zero():
    image = texture()
    assert not crossfit(image, image).any()


def test_the_flow_of_a_half_never_sees_the_other_half_of_the_render():
    photo, true_px = texture(), smooth_flow(2, 20)
    render = warp.warp(photo, true_px)
    kept = controls.checkerboard(HEIGHT, WIDTH, block_px=12)
    options = {"flow_of": estimate.estimate, "block_px": 12, "passages": 2}
    found_px = controls.flow_of_half(render, photo, kept, **options)
    other = np.where(kept[..., None], render, texture(5))
    again_px = controls.flow_of_half(other, photo, kept, **options)
    np.testing.assert_array_equal(found_px, again_px)
    # That it would show: the other half's flow does change.
    found_px, changed_px = (
        controls.flow_of_half(image, photo, ~kept, **options)
        for image in (render, other)
    )
    assert np.abs(changed_px - found_px).max() > 0.5


def test_each_pixel_is_crossfit_once():
    photo, seen = texture(), []

    def flow_of(render, photo):
        seen.append(render)
        return np.full((HEIGHT, WIDTH, 2), float(len(seen)), np.float32)

    found_px = controls.crossfit_flow(photo, photo, flow_of=flow_of, passages=1)
    kept = controls.checkerboard(HEIGHT, WIDTH)
    assert 0.45 < kept.mean() < 0.55
    np.testing.assert_array_equal(seen[0][kept], photo[kept])
    np.testing.assert_array_equal(seen[1][~kept], photo[~kept])
    np.testing.assert_allclose(found_px[~kept], 1.0, rtol=1e-5)
    np.testing.assert_allclose(found_px[kept], 2.0, rtol=1e-5)


def test_spread_keeps_and_fills_from_the_kept_alone(rng):
    kept = controls.checkerboard(40, 50, block_px=6)
    values = rng.normal(size=(40, 50, 2)).astype(np.float32)
    filled = controls.spread(values, kept, sigma_px=3)
    np.testing.assert_array_equal(filled[kept], values[kept])
    # Not even what is not finite gets out of the held-out pixels.
    values[~kept] = np.nan
    np.testing.assert_array_equal(controls.spread(values, kept, sigma_px=3), filled)
    assert np.abs(filled[~kept]).max() <= np.abs(values[kept]).max()
    constant = np.full((40, 50, 2), 7.0)
    np.testing.assert_allclose(
        controls.spread(constant, kept, sigma_px=3), constant, rtol=1e-6
    )
    nowhere = np.zeros((40, 50), bool)
    nowhere[0, 0] = True
    with pytest.raises(ValueError, match="within reach"):
        controls.spread(values, nowhere, sigma_px=1)


def test_images_within_one_block_are_refused():
    image = np.zeros((10, 10, 3), np.uint8)
    with pytest.raises(ValueError, match="larger than blocks of 12 px"):
        controls.crossfit_flow(image, image, flow_of=estimate.estimate)


@pytest.mark.parametrize("size", [(150, 200), (33, 500), (1, 40), (40, 1), (2, 2)])
def test_a_placebo_is_random_smooth_and_at_most_half_a_pixel(size):
    lengths = []
    for view in ("a", "view_001", "b c"):
        flow_px = controls.placebo_flow(*size, view=view)
        assert (flow_px.shape, flow_px.dtype) == ((*size, 2), np.float32)
        length_px = np.linalg.norm(flow_px, axis=-1)
        assert 0.499 < length_px.max() <= 0.5
        if min(size) > 30:
            assert np.abs(np.diff(flow_px, axis=0)).max() < 0.1
            assert np.abs(np.diff(flow_px, axis=1)).max() < 0.1
        assert warp.in_frame(flow_px).all()
        lengths.append(length_px)
    # Another one for each name, and the same whatever other views there are.
    assert np.abs(lengths[0] - lengths[1]).max() > 0.01
    again = np.linalg.norm(controls.placebo_flow(*size, view="a"), axis=-1)
    np.testing.assert_array_equal(again, lengths[0])


@pytest.mark.parametrize("seed", SEEDS)
def test_a_resharpened_copy_is_as_different_as_the_photo_and_not_displaced(seed):
    photo, true_px = texture(seed), smooth_flow(2, 30, seed)
    render = degrade(warp.warp(photo, true_px), blur_px=1.5, noise=8, correlated_px=1.5)
    copy = controls.resharpened(render, photo, true_px)
    aligned = warp.warp(photo, true_px)
    assert psnr_db(copy, render) == pytest.approx(psnr_db(aligned, render), abs=0.5)
    sharpness = [
        cv2.Laplacian(image.astype(np.float32), cv2.CV_32F)[INNER].std()
        for image in (render, copy, aligned)
    ]
    assert sharpness[0] < 0.9 * sharpness[1]
    # The photo's displacement is not in it, although a flow is found.
    found_px = crossfit(render, copy)
    left_px = np.abs(np.median(found_px[INNER].reshape(-1, 2), axis=0))
    assert left_px.max() < 0.1
    assert gain_db(render, copy, found_px) < 0.02
    assert gain_db(render, copy, in_sample(render, copy, estimate.DEFAULT)) > 0
