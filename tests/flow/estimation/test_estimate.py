"""flow.estimation.estimate: direction, accuracy, extremes."""

import cv2
import numpy as np
import pytest

from alignerf.io import images
from flow.estimation import estimate, estimators
from flow.warping import files, warp

SEQUENCES = {  # mean end-point error in px that the methods of FAST stay below
    "RubberWhale": (0.24, 0.17),
    "Dimetrodon": (0.17, 0.14),
    "Grove2": (0.34, 0.22),
    "Urban2": (0.68, 0.52),
}
FAST = ("dis_medium", "dis_fine")
SMALLEST = {name: estimator.min_side_px for name, estimator in estimate.METHODS.items()}


def slow(name):
    """What `make tools` has alone."""
    return pytest.param(name, marks=pytest.mark.whole)


def texture(height, width, seed=0, grain_px=1.5):
    """Random RGB image [height, width, 3] uint8 with structure at several scales."""
    rng = np.random.default_rng(seed)
    total = np.zeros((height, width, 3))
    for octave in range(4):
        noise = rng.normal(size=(height, width, 3))
        layer = cv2.GaussianBlur(noise, (0, 0), grain_px * 2**octave)
        total += layer / layer.std()
    return np.clip(127 + 25 * total, 0, 255).astype(np.uint8)


def smooth_flow(height, width, longest_px, seed=0):
    """Smooth random flow [height, width, 2] float32."""
    noise = np.random.default_rng(seed).normal(size=(height, width, 2))
    flow = cv2.GaussianBlur(noise, (0, 0), min(height, width) / 8)
    longest = np.linalg.norm(flow, axis=-1).max()
    return (flow * longest_px / longest).astype(np.float32)


def error_px(flow_px, true_px, margin=8):
    """Mean end-point error away from the border."""
    miss = np.linalg.norm(flow_px - true_px, axis=-1)
    return miss[margin:-margin, margin:-margin].mean()


@pytest.mark.parametrize("method", estimate.METHODS)
@pytest.mark.parametrize(("dx", "dy"), [(3, 0), (-4, 2), (2, -5)])
def test_direction_by_plain_indexing(method, dx, dy):
    # render[y, x] = photo[y + dy, x + dx], so that the flow is (dx, dy): no code of
    # the package takes part in the expectation.
    scene = texture(180, 240)
    photo = scene[20:140, 20:180]
    render = scene[20 + dy : 140 + dy, 20 + dx : 180 + dx]
    flow_px = estimate.estimate(render, photo, method=method)
    assert flow_px.shape == (120, 160, 2)
    assert flow_px.dtype == np.float32
    inner = flow_px[16:-16, 16:-16]
    assert np.abs(np.median(inner, axis=(0, 1)) - (dx, dy)).max() < 0.25
    warped = warp.warp(photo, flow_px).astype(float)
    missed = np.abs(warped - render)[16:-16, 16:-16].mean()
    unwarped = np.abs(photo.astype(float) - render)[16:-16, 16:-16].mean()
    assert missed < 0.25 * unwarped


def test_direction_of_an_asymmetric_mark():
    # A ramp with one bright L: mirrored or transposed flows cannot pass.
    photo = texture(96, 128, grain_px=3) // 4
    photo[30:60, 40:46] = 255
    photo[54:60, 40:70] = 255
    render = np.roll(photo, (-2, 5), axis=(0, 1))
    flow_px = estimate.estimate(render, photo, method="dis_medium")
    on_mark = flow_px[30:55, 46:50]
    assert np.abs(np.median(on_mark, axis=(0, 1)) - (-5, 2)).max() < 0.5


@pytest.mark.parametrize("method", FAST)
@pytest.mark.parametrize("longest_px", [1, 2, 4])
def test_recovers_smooth_flows(method, longest_px):
    for seed in range(2):
        photo = texture(150, 200, seed)
        true_px = smooth_flow(150, 200, longest_px, seed)
        render = warp.warp(photo, true_px)
        found_px = estimate.estimate(render, photo, method=method)
        assert error_px(found_px, true_px) < 0.15 * longest_px


@pytest.mark.parametrize("method", FAST)
@pytest.mark.parametrize("sigma_px", [1.0, 2.0])
def test_blur_matching_takes_no_blur_for_motion(method, sigma_px):
    plain, matched = [], []
    for seed in range(2):
        photo = texture(150, 200, seed)
        true_px = smooth_flow(150, 200, 2, seed)
        render = cv2.GaussianBlur(warp.warp(photo, true_px), (0, 0), sigma_px)
        for errors, match_blur in ((plain, False), (matched, True)):
            found_px = estimate.estimate(
                render, photo, method=method, match_blur=match_blur
            )
            errors.append(error_px(found_px, true_px))
    assert np.mean(matched) < np.mean(plain)


def test_blur_matching_finds_the_blur_in_spite_of_misalignment():
    for seed, sigma_px in enumerate((0.0, 1.0, 1.5, 2.0, 3.0)):
        photo = texture(150, 200, seed)
        render = warp.warp(photo, smooth_flow(150, 200, 3, seed))
        if sigma_px:
            render = cv2.GaussianBlur(render, (0, 0), sigma_px)
        blurred, found_px = estimate.blur_match(photo, render)
        assert abs(found_px - sigma_px) <= 0.5
        assert blurred.shape == photo.shape
        assert blurred.dtype == np.uint8


@pytest.mark.parametrize("method", [*FAST, estimate.DEFAULT])
def test_aligned_but_blurred_gives_no_flow_when_matched(method):
    photo = texture(150, 200)
    render = cv2.GaussianBlur(photo, (0, 0), 2.0)
    plain, matched = (
        np.linalg.norm(
            estimate.estimate(render, photo, method=method, match_blur=match_blur),
            axis=-1,
        ).mean()
        for match_blur in (False, True)
    )
    assert plain > 0.01
    assert matched < 0.25 * plain


@pytest.mark.parametrize("method", estimate.METHODS)
@pytest.mark.parametrize("match_blur", [False, True])
def test_identical_images_have_exactly_zero_flow(method, match_blur):
    noise = np.random.default_rng(0).integers(0, 256, (61, 83, 3), dtype=np.uint8)
    for image in (texture(60, 80), noise, np.full_like(noise, 7)):
        flow_px = estimate.estimate(
            image, image.copy(), method=method, match_blur=match_blur
        )
        assert not flow_px.any()


@pytest.mark.parametrize("method", estimate.METHODS)
def test_estimators_themselves_find_nothing_between_equal_images(method):
    image = texture(100, 120)
    found_px = estimate.METHODS[method].calculate(image, image.copy())
    assert np.abs(found_px).max() < 1e-30


@pytest.mark.parametrize("method", estimate.METHODS)
@pytest.mark.parametrize("match_blur", [False, True])
def test_flat_images_give_finite_flow(method, match_blur):
    levels = [np.full((48, 50, 3), v, np.uint8) for v in (0, 128, 255)]
    pairs = [(a, b) for a in levels for b in levels]
    pairs += [(levels[1], texture(48, 50)), (texture(48, 50), levels[1])]
    for render, photo in pairs:
        flow_px = estimate.estimate(render, photo, method=method, match_blur=match_blur)
        assert np.isfinite(flow_px).all()


@pytest.mark.parametrize("method", estimate.METHODS)
def test_smallest_and_odd_sizes(method):
    least = SMALLEST[method]
    sizes = [(0, 0), (1, 15), (0, 609), (368, 0), (63, 31)]
    for size in [(least + dy, least + dx) for dy, dx in sizes]:
        photo = texture(*size)
        flow_px = estimate.estimate(np.roll(photo, 1, axis=1), photo, method=method)
        assert flow_px.shape == (*size, 2)
        assert np.abs(np.median(flow_px, axis=(0, 1)) - (-1, 0)).max() < 0.2
        assert np.isfinite(flow_px).all()


@pytest.mark.parametrize("method", estimate.METHODS)
@pytest.mark.parametrize("size", [(8, 8), (24, 32), (31, 200), (200, 31), (64, 1)])
def test_too_small_is_refused(method, size):
    # 31x200 would crash the process inside OpenCV.
    black = np.zeros((*size, 3), np.uint8)
    with pytest.raises(ValueError, match=f"{size[1]}x{size[0]} pixels are too small"):
        estimate.estimate(black, black, method=method)


@pytest.mark.parametrize("method", estimate.METHODS)
def test_a_shift_of_one_pixel_at_the_border(method):
    # What lies beyond the frame is seen by neither: the border's own pixels must move
    # as the rest does.
    scene = texture(140, 180, seed=2)
    photo, render = scene[4:130, 4:170], scene[4:130, 5:171]
    flow_px = estimate.estimate(render, photo, method=method)
    for edge in (flow_px[:2], flow_px[-2:], flow_px[:, :2], flow_px[:, -2:]):
        assert np.abs(np.median(edge.reshape(-1, 2), axis=0) - (1, 0)).max() < 0.25


@pytest.mark.parametrize("method", ["dis_fast", slow("deepflow")])
def test_very_wide_images(method):
    photo = texture(SMALLEST[method], 16384)
    flow_px = estimate.estimate(np.roll(photo, -2, axis=1), photo, method=method)
    for part in np.split(flow_px[8:-8], 8, axis=1):
        assert np.abs(np.median(part, axis=(0, 1)) - (2, 0)).max() < 0.25


def test_a_method_that_fails_is_named(monkeypatch):
    def fail(render, photo):
        raise cv2.error("OpenCV(5.0.0) x.cpp:1: error: it broke")

    def unknown(render, photo):
        return np.full((*render.shape[:2], 2), np.nan, np.float32)

    for calculate, reason in (
        (fail, "failed in OpenCV: .*it broke"),
        (unknown, "gave a flow that is not finite"),
    ):
        broken = estimators.Estimator(calculate, 32)
        monkeypatch.setitem(estimate.METHODS, "broken", broken)
        with pytest.raises(ValueError, match=f"broken {reason}"):
            estimate.estimate(texture(40, 40), texture(40, 40, seed=1), method="broken")


def test_bad_images_are_refused_with_the_reason():
    good = texture(40, 50)
    nan = np.full(good.shape, np.nan, np.float32)
    for bad in (good / 255.0, nan, good[..., 0], good[..., :2], good.astype(np.int16)):
        for pair in ((bad, good), (good, bad)):
            with pytest.raises(ValueError, match="8-bit RGB"):
                estimate.estimate(*pair)
    with pytest.raises(ValueError, match="50x40 against 40x40"):
        estimate.estimate(good, good[:, :40])
    with pytest.raises(ValueError, match="'nothing' is not one of dis_"):
        estimate.estimate(good, good, method="nothing")


@pytest.mark.parametrize("method", estimate.METHODS)
def test_same_bits_for_any_number_of_threads(method):
    photo = texture(150, 200)
    render = warp.warp(photo, smooth_flow(150, 200, 3))
    before = cv2.getNumThreads()
    results = []
    try:
        for threads in (1, 2, 3, 7):
            cv2.setNumThreads(threads)
            results.append(estimate.estimate(render, photo, method=method))
    finally:
        cv2.setNumThreads(before)
    for result in results[1:]:
        np.testing.assert_array_equal(result, results[0])


def test_views_of_larger_arrays_are_read_rightly():
    scene = texture(120, 200)
    render, photo = scene[::2, 3:-3, ::-1], scene[::2, 6:, ::-1]
    np.testing.assert_array_equal(
        estimate.estimate(render, photo), estimate.estimate(render.copy(), photo.copy())
    )


@pytest.mark.parametrize(
    "name", ["RubberWhale", *map(slow, ("Dimetrodon", "Grove2", "Urban2"))]
)
def test_middlebury(shared_data, name):
    folder = shared_data / "flow" / name
    frames = [images.read(folder / f"frame1{i}.png") for i in (0, 1)]
    true_px, known = files.read_flo(folder / "flow10.flo")
    for method, below_px in zip(FAST, SEQUENCES[name], strict=True):
        found_px = estimate.estimate(*frames, method=method)
        assert np.linalg.norm(found_px - true_px, axis=-1)[known].mean() < below_px


def test_a_faster_estimator_may_check_a_flow():
    photo = texture(96, 128)
    render = warp.warp(photo, smooth_flow(96, 128, longest_px=2.0))
    # What no flow explains: another texture in a corner.
    render[:30, :40] = texture(30, 40, seed=5)
    own = estimate.flow_and_validity(render, photo, method="deepflow", match_blur=False)
    other = estimate.flow_and_validity(
        render, photo, method="deepflow", match_blur=False, back="dis_fine"
    )
    np.testing.assert_array_equal(other[0], own[0])
    assert (other[1] == own[1]).mean() > 0.9
    away = np.s_[40:-8, 50:-8]
    assert other[1][away].mean() > 0.98
    assert other[1][5:25, 5:35].mean() < 0.5
