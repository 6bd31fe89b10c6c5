"""flow.warping.warp: identity, direction, validity, inverse, round trip."""

import cv2
import numpy as np
import pytest

from flow.warping import warp


def noise(height, width, seed=0):
    rng = np.random.default_rng(seed)
    return rng.integers(0, 256, (height, width, 3), dtype=np.uint8)


def constant(height, width, dx, dy):
    return np.broadcast_to(np.float32([dx, dy]), (height, width, 2)).copy()


def smooth_flow(height, width, longest_px, seed=0):
    random = np.random.default_rng(seed).normal(size=(height, width, 2))
    flow = cv2.GaussianBlur(random, (0, 0), min(height, width) / 8)
    longest = np.linalg.norm(flow, axis=-1).max()
    return (flow * longest_px / longest).astype(np.float32)


@pytest.mark.parametrize("kernel", warp.KERNELS)
@pytest.mark.parametrize("size", [(1, 1), (1, 40), (40, 1), (7, 9), (150, 200)])
def test_zero_flow_is_the_identity_to_the_bit(kernel, size):
    image = noise(*size)
    warped = warp.warp(image, np.zeros((*size, 2), np.float32), kernel=kernel)
    np.testing.assert_array_equal(warped, image)
    assert warped.dtype == np.uint8


@pytest.mark.parametrize("kernel", warp.KERNELS)
def test_whole_pixels_are_plain_indexing(kernel):
    rng = np.random.default_rng(0)
    for _ in range(20):
        image = noise(30, 40, seed=rng.integers(1 << 30))
        dx, dy = rng.integers(-6, 7, 2)
        warped = warp.warp(image, constant(30, 40, dx, dy), kernel=kernel)
        np.testing.assert_array_equal(
            warped[6:-6, 6:-6], image[6 + dy : 24 + dy, 6 + dx : 34 + dx]
        )


def test_two_warps_in_one():
    # The first warp reads 3 px to the right, where the second reads 2 px further down.
    first, second = constant(40, 50, 3, 0), np.zeros((40, 50, 2), np.float32)
    second[:, 20:] = [0, 2]
    together = warp.compose(first, second)
    np.testing.assert_array_equal(together[:, :17], constant(40, 17, 3, 0))
    np.testing.assert_array_equal(together[:, 17:], constant(40, 33, 3, 2))
    image = noise(40, 50)
    np.testing.assert_array_equal(
        warp.warp(image, together), warp.warp(warp.warp(image, second), first)
    )
    for longest_px in (0.5, 3.0):
        flow_px = smooth_flow(60, 80, longest_px)
        inverse_px, valid = warp.invert(flow_px)
        left_px = np.linalg.norm(warp.compose(inverse_px, flow_px), axis=-1)
        assert left_px[valid].max() < 0.1
    with pytest.raises(ValueError, match="differ in size"):
        warp.compose(first, first[:-1])


def test_x_comes_first():
    # Brightness grows to the right only: taking it 5 px to the right is brighter.
    ramp = np.broadcast_to(
        np.arange(60, dtype=np.uint8)[None, :, None] * 4, (50, 60, 3)
    )
    inner = np.s_[10:-10, 10:-10]
    brighter = warp.warp(ramp, constant(50, 60, 5, 0))[inner].astype(int)
    np.testing.assert_array_equal(brighter - ramp[inner], 20)
    np.testing.assert_array_equal(warp.warp(ramp, constant(50, 60, 0, 5)), ramp)


def test_fractions_of_a_pixel_on_a_smooth_image():
    y, x = np.mgrid[:80, :100]

    def wave(x, y):
        value = 127 + 60 * np.sin(0.2 * x) + 50 * np.cos(0.15 * y + 0.1 * x)
        return np.repeat(value[..., None], 3, axis=-1)

    image = np.rint(wave(x, y)).astype(np.uint8)
    for seed in range(5):
        flow_px = smooth_flow(80, 100, 3, seed)
        expected = wave(x + flow_px[..., 0], y + flow_px[..., 1])
        warped = warp.warp(image, flow_px)
        assert np.abs(warped - expected)[8:-8, 8:-8].max() < 2


def test_overshoot_is_clipped_not_wrapped():
    step = np.zeros((40, 40, 3), np.uint8)
    step[:, 20:] = 255
    warped = warp.warp(step, constant(40, 40, 0.5, 0.25))
    assert (warped[:, :17] <= 30).all()
    assert (warped[:, 23:] >= 225).all()


def test_lanczos_keeps_what_bilinear_smooths():
    image = noise(100, 100)
    half = constant(100, 100, 0.5, 0.5)
    spread = [
        warp.warp(image, half, kernel=kernel)[8:-8, 8:-8].std()
        for kernel in ("lanczos", "cubic", "bilinear")
    ]
    assert spread[0] > spread[1] > spread[2]


def test_in_frame_is_a_matter_of_positions():
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:20, :30]
    for _ in range(20):
        flow_px = rng.normal(scale=15, size=(20, 30, 2)).astype(np.float32)
        to_x, to_y = x + flow_px[..., 0], y + flow_px[..., 1]
        outside = (to_x < -0.5) | (to_x > 29.5) | (to_y < -0.5) | (to_y > 19.5)
        np.testing.assert_array_equal(warp.in_frame(flow_px), ~outside)
    assert warp.in_frame(np.zeros((20, 30, 2), np.float32)).all()
    assert not warp.in_frame(np.full((20, 30, 2), np.nan, np.float32)).any()
    assert not warp.in_frame(np.full((20, 30, 2), 1e30, np.float32)).any()


@pytest.mark.parametrize("kernel", warp.KERNELS)
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (3, 3), (20, 30)])
def test_far_flows_end_and_take_the_border(kernel, size):
    image = noise(*size)
    for far in (1e3, 1e5, 1e30):
        warped = warp.warp(image, constant(*size, far, 0), kernel=kernel)
        assert warped.shape == image.shape
        if far < 1e5:
            np.testing.assert_array_equal(
                warped, np.broadcast_to(image[:, -1:], image.shape)
            )


def test_forward_and_backward_agree_on_a_shift():
    forward_px, backward_px = constant(40, 50, 3, -2), constant(40, 50, -3, 2)
    agrees = warp.consistent(forward_px, backward_px, tolerance_px=0.01)
    np.testing.assert_array_equal(agrees, warp.in_frame(forward_px))
    assert agrees.sum() == 38 * 47
    opposite = warp.consistent(forward_px, forward_px, tolerance_px=1.0)
    assert not opposite.any()


def test_forward_backward_finds_an_occlusion():
    # A box that stands at x = 20..39 in the render and 8 px to the right in the
    # photo: the render's pixels 40..47 see ground that the box hides in the photo.
    forward_px, backward_px = constant(40, 80, 0, 0), constant(40, 80, 0, 0)
    forward_px[10:30, 20:40] = (8, 0)
    backward_px[10:30, 28:48] = (-8, 0)
    agrees = warp.consistent(forward_px, backward_px, tolerance_px=1.0)
    expected = np.ones((40, 80), bool)
    expected[10:30, 40:48] = False
    np.testing.assert_array_equal(agrees, expected)


def test_tolerance_is_a_length():
    forward_px, backward_px = constant(9, 9, 0.0, 0.0), constant(9, 9, 0.3, 0.4)
    assert warp.consistent(forward_px, backward_px, tolerance_px=0.51).all()
    assert not warp.consistent(forward_px, backward_px, tolerance_px=0.49).any()
    for bad in (-1.0, np.nan):
        with pytest.raises(ValueError, match="tolerance_px"):
            warp.consistent(forward_px, backward_px, tolerance_px=bad)


@pytest.mark.parametrize("longest_px", [0.5, 2, 4])
def test_round_trip_of_smooth_flows_displaces_nothing(longest_px):
    y, x = np.mgrid[:150, :200].astype(np.float32)
    for seed in range(4):
        flow_px = smooth_flow(150, 200, longest_px, seed)
        inverse_px, valid = warp.invert(flow_px)
        assert valid[8:-8, 8:-8].mean() > 0.99
        # Positions by an independent, unrounded interpolation of f at y + g(y).
        at_x, at_y = x + inverse_px[..., 0], y + inverse_px[..., 1]
        inside = (at_x >= 0) & (at_x <= 199) & (at_y >= 0) & (at_y <= 149) & valid
        returned = inverse_px + _bilinear(flow_px, at_x, at_y)
        assert np.linalg.norm(returned, axis=-1)[inside].max() < 0.05


def _bilinear(values, at_x, at_y):
    x0 = np.clip(np.floor(at_x).astype(int), 0, values.shape[1] - 2)
    y0 = np.clip(np.floor(at_y).astype(int), 0, values.shape[0] - 2)
    tx, ty = (at_x - x0)[..., None], (at_y - y0)[..., None]
    above = (1 - tx) * values[y0, x0] + tx * values[y0, x0 + 1]
    below = (1 - tx) * values[y0 + 1, x0] + tx * values[y0 + 1, x0 + 1]
    return (1 - ty) * above + ty * below


def test_round_trip_is_near_the_photo_and_interpolates():
    photo = cv2.GaussianBlur(noise(150, 200), (0, 0), 1.5)
    flow_px = smooth_flow(150, 200, 3)
    there = np.abs(warp.warp(photo, flow_px).astype(int) - photo).mean()
    control = warp.round_trip(photo, flow_px)
    back = np.abs(control.astype(int) - photo).mean()
    assert 0 < back < 0.1 * there
    zero = np.zeros_like(flow_px)
    np.testing.assert_array_equal(warp.round_trip(photo, zero), photo)


def test_round_trip_keeps_the_photo_where_the_flow_has_no_inverse():
    photo = noise(60, 80)
    y, x = np.mgrid[:60, :80]
    collapse = np.stack([40.0 - x, 30.0 - y], axis=-1).astype(np.float32)
    outside = constant(60, 80, 500, 0)
    for flow_px in (collapse, outside):
        _, valid = warp.invert(flow_px)
        assert valid.mean() < 0.01
        control = warp.round_trip(photo, flow_px)
        np.testing.assert_array_equal(control[~valid], photo[~valid])


def test_round_trip_at_a_jump_of_the_flow_displaces_nothing():
    # A position image tells where each pixel of the control came from.
    ramp = np.zeros((60, 80, 3), np.uint8)
    ramp[..., 0] = 3 * np.arange(80)
    ramp[..., 1] = 4 * np.arange(60)[:, None]
    flow_px = constant(60, 80, 0, 0)
    flow_px[20:40, 30:50] = (5, -3)
    moved = np.abs(warp.round_trip(ramp, flow_px).astype(int) - ramp)
    assert moved.max() <= 1


def test_bad_input_is_refused_with_the_reason():
    image, flow_px = noise(10, 12), constant(10, 12, 0, 0)
    with pytest.raises(ValueError, match="8-bit RGB"):
        warp.warp(image / 255.0, flow_px)
    with pytest.raises(ValueError, match="differ in size"):
        warp.warp(image, flow_px[:9])
    with pytest.raises(ValueError, match="'box' is not one of lanczos"):
        warp.warp(image, flow_px, kernel="box")
    for bad in (np.nan, np.inf):
        with pytest.raises(ValueError, match="not finite"):
            warp.warp(image, flow_px + np.float32(bad))
    with pytest.raises(ValueError, match="floating"):
        warp.warp(image, flow_px.astype(int))
    with pytest.raises(ValueError, match="sides must be from 1 to 32766"):
        warp.warp(noise(1, 32767), constant(1, 32767, 0, 0))
    with pytest.raises(ValueError, match="sides must be from 1"):
        warp.warp(noise(0, 5), constant(0, 5, 0, 0))
    longest = noise(1, 32766)
    same = warp.warp(longest, constant(1, 32766, 0, 0))
    np.testing.assert_array_equal(same, longest)


def test_what_something_nearer_hides_is_occluded():
    """A near square moves by 5 px: it hides the strip that it moves over, no more."""
    depth = np.full((40, 60), 10.0, np.float32)
    depth[10:30, 20:40] = 2.0
    flow_px = np.zeros((40, 60, 2), np.float32)
    flow_px[10:30, 20:40, 0] = 5.0
    visible = warp.unoccluded(flow_px, depth)
    hidden = np.zeros((40, 60), bool)
    hidden[10:30, 40:45] = True
    np.testing.assert_array_equal(~visible, hidden)
    # Something farther hides nothing: it is hidden itself where it moves to.
    depth[10:30, 20:40] = 20.0
    hidden = np.zeros((40, 60), bool)
    hidden[10:30, 35:40] = True
    np.testing.assert_array_equal(~warp.unoccluded(flow_px, depth), hidden)


def test_a_surface_does_not_hide_itself():
    """Nor does what leaves the image, however near."""
    slope = np.linspace(1.0, 3.0, 64, dtype=np.float32)
    depth = np.tile(slope, (48, 1))
    shrink = np.zeros((48, 64, 2), np.float32)
    shrink[..., 0] = -0.3 * np.arange(64)
    assert warp.unoccluded(shrink, depth).all()
    leaving = np.zeros((48, 64, 2), np.float32)
    leaving[:, :32, 0] = -1000.0
    assert warp.unoccluded(leaving, np.full((48, 64), 1.0)).all()


@pytest.mark.parametrize(
    ("depth", "reason"),
    [
        (np.ones((8, 9)), "differ in size"),
        (np.zeros((8, 8)), "not positive"),
        (np.full((8, 8), np.nan), "not positive"),
    ],
)
def test_a_depth_that_is_none_is_refused(depth, reason):
    with pytest.raises(ValueError, match=reason):
        warp.unoccluded(np.zeros((8, 8, 2), np.float32), depth)
