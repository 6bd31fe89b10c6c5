"""What a training leaves says how it warped its photos: to the bit."""

import numpy as np

from alignerf.alignment import store, warped
from alignerf.exports import warps
from alignerf.io import images
from alignerf.training import batches

H, W, K = 50, 67, 3


def test_offsets_on_disk_warp_a_photo_as_the_training_did(tmp_path, rng):
    """Also those of sides that no block divides; photos that stayed have none."""
    taken = batches.Views(
        photos=rng.integers(0, 256, (3, H, W, 3), dtype=np.uint8),
        valid=batches.all_valid(3, H, W),
        pixtocams=np.tile(np.eye(3, dtype=np.float32), (3, 1, 1)),
        camtoworlds=np.tile(np.eye(4, dtype=np.float32)[:3], (3, 1, 1)),
    )
    offsets_px = rng.normal(size=(3, H // K, W // K, 2)).astype(np.float32)
    # The second is displaced out of its frame, the third not at all.
    offsets_px[1], offsets_px[2] = 1e4, 0
    now = warped.warped(taken, offsets_px, K)
    store.write_photos(tmp_path, "abc", now, taken, offsets_px, K)
    assert warps.are_known("abc", tmp_path / "valid")
    for i, name in enumerate("abc"):
        one = warps.Warp(tmp_path / "valid" / f"{name}.npz", (H, W))
        photo = images.read(tmp_path / "photos" / f"{name}.png")
        np.testing.assert_array_equal(one.photo(taken.photos[i]), photo)
        assert np.array_equal(photo, taken.photos[i]) == (i > 0)
        counts = one.mask(np.full((H, W, 3), 255, np.uint8)).all(axis=-1)
        np.testing.assert_array_equal(counts, batches.unpack_valid(now.valid[i], W))


def test_photos_that_no_alignment_warped_have_no_offsets(tmp_path, rng):
    taken = batches.Views(
        photos=rng.integers(0, 256, (1, H, W, 3), dtype=np.uint8),
        valid=batches.all_valid(1, H, W),
        pixtocams=np.eye(3, dtype=np.float32)[None],
        camtoworlds=np.eye(4, dtype=np.float32)[None, :3],
    )
    store.write_photos(tmp_path, "a", taken, taken, None, K)
    one = warps.Warp(tmp_path / "valid/a.npz", (2 * H, 2 * W))
    flow_px, valid = one.large()
    assert flow_px.shape == (2 * H, 2 * W, 2)
    assert not flow_px.any()
    assert valid.all()
