"""Images made small for a flow, and flows made large again."""

import numpy as np
import pytest

from alignerf.scenes import cameras
from flow.warping import small, warp


@pytest.mark.parametrize("k", [1, 2, 3, 5])
def test_a_small_pixel_is_the_mean_of_its_block(rng, k):
    image = rng.integers(0, 256, (31, 47, 3), dtype=np.uint8)
    found = small.shrink(image, k)
    h, w = 31 // k, 47 // k
    blocks = image[: h * k, : w * k].reshape(h, k, w, k, 3).mean(axis=(1, 3))
    assert found.shape == (h, w, 3)
    assert np.abs(found - blocks).max() <= 0.5 + 1e-6


@pytest.mark.parametrize("k", [1, 2, 3])
def test_a_block_counts_where_all_its_pixels_do(rng, k):
    mask = rng.uniform(size=(31, 47)) < 0.9
    found = small.shrink_mask(mask, k)
    assert found.shape == (31 // k, 47 // k)
    for y, x in np.ndindex(found.shape):
        assert found[y, x] == mask[y * k : y * k + k, x * k : x * k + k].all()


@pytest.mark.parametrize("k", [2, 3])
def test_a_small_pixels_ray_is_its_blocks_middle_and_its_cone_k_times_as_wide(k):
    pixtocam = cameras.intrinsics(50.0, 60, 48)
    pose = np.eye(4)[:3]
    few = small.shrink_pixtocam(pixtocam, k)
    ray = cameras.pixels_to_rays(np.array(4), np.array(7), few, pose)
    middle = [k * place + (k - 1) / 2 for place in (4.0, 7.0)]
    large = cameras.pixels_to_rays(*map(np.array, middle), pixtocam, pose)
    np.testing.assert_allclose(ray.directions, large.directions, atol=1e-12)
    np.testing.assert_allclose(ray.radii, k * large.radii, rtol=1e-12)


@pytest.mark.parametrize("k", [1, 2, 3])
def test_a_flow_that_grows_evenly_is_the_same_flow_when_it_is_large(k):
    h, w = 48, 60
    y, x = np.indices((h, w), np.float64)
    large = np.stack([0.02 * x - 0.5, 0.03 * y + 1], axis=-1)
    y, x = ((axis + 0.5) * k - 0.5 for axis in np.indices((h // k, w // k)))
    little = np.stack([0.02 * x - 0.5, 0.03 * y + 1], axis=-1) / k
    found = small.enlarge(little, k, (h, w))
    inner = (slice(k, -k),) * 2
    # cv2.remap holds places to 1/32 of a small pixel.
    np.testing.assert_allclose(found[inner], large[inner], atol=0.03 * k / 16)


def test_a_flow_made_large_moves_a_photo_as_it_moved_the_small_one(rng):
    """What is aligned small is aligned at full size: the direction and the scale."""
    k = 3
    image = np.zeros((72, 96, 3), np.uint8)
    image[24:48, 30:60] = rng.integers(100, 256, 3)
    shifted = np.roll(image, (6, 9), axis=(0, 1))
    flow_px = np.full((24, 32, 2), [3.0, 2.0], np.float32)
    found = warp.warp(shifted, small.enlarge(flow_px, k, image.shape[:2]))
    np.testing.assert_array_equal(found[12:60, 18:72], image[12:60, 18:72])


def test_rows_that_fill_no_block_go_on_like_their_neighbours():
    flow_px = np.full((10, 13, 2), 0.5, np.float32)
    found = small.enlarge(flow_px, 3, (32, 41))
    np.testing.assert_allclose(found, 1.5, rtol=1e-6)
