"""A scene with smaller photos: the same views, and rays through the same places."""

import numpy as np
import pytest

from alignerf import shrink
from alignerf.files import images
from alignerf.scenes import cameras, prepared

WIDTH, HEIGHT = 96, 70


@pytest.fixture
def folder(tmp_path, rng):
    """A scene of three views whose stored poses are not normalised."""
    poses = np.repeat(np.eye(4)[None, :3], 3, axis=0)
    poses[:, :, 3] = rng.normal(size=(3, 3)) * [5.0, 5.0, 1.0] + 7.0
    np.savez(
        tmp_path / "cameras.npz",
        pixtocams=np.stack([cameras.intrinsics(80.0, WIDTH, HEIGHT)] * 3),
        camtoworlds=poses,
        names=["a b", "c", "d"],
        width=WIDTH,
        height=HEIGHT,
        split=["test", "train", "train"],
    )
    for view in ("a b", "c", "d"):
        image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        images.write(tmp_path / "images" / f"{view}.png", image)
    return tmp_path


def run(folder, factor):
    out = folder / "smaller"
    shrink.main(["--scene", str(folder), f"--factor={factor}", f"--out={out}"])
    return prepared.load(folder), prepared.load(out)


def test_an_exact_factor_averages_blocks(folder):
    before, after = run(folder, 2)
    views = np.arange(3)
    large = prepared.read_images(before, views, folder / "images").astype(float)
    small = prepared.read_images(after, views, folder / "smaller" / "images")
    blocks = large.reshape(3, HEIGHT // 2, 2, WIDTH // 2, 2, 3).mean(axis=(2, 4))
    assert np.abs(small - blocks).max() <= 0.5
    assert (after.names, after.split.tolist()) == (before.names, before.split.tolist())


@pytest.mark.parametrize("factor", [1.5, 2, 2.17])
def test_corners_of_the_photos_stay_where_they_were(folder, factor):
    """Through the true ratios of the sizes, which rounding moves off the factor."""
    before, after = run(folder, factor)
    assert after.width == round(WIDTH / factor)
    for large, small in ((0, 0), (WIDTH, after.width)):
        corner = np.array([large, large * HEIGHT / WIDTH, 1.0])
        same = np.array([small, small * after.height / after.width, 1.0])
        np.testing.assert_allclose(
            before.pixtocams[0] @ corner, after.pixtocams[0] @ same, atol=1e-12
        )


def test_the_frame_is_that_of_the_scene(folder):
    """Else a model trained on the smaller photos could not be rendered there."""
    before, after = run(folder, 2)
    np.testing.assert_array_equal(after.camtoworlds, before.camtoworlds)


@pytest.mark.parametrize(
    ("factor", "reason"),
    [(0.5, "--factor: 0.5"), ("nan", "--factor: nan"), (9, "smaller than 32 px")],
)
def test_a_factor_that_cannot_be_is_named(folder, factor, reason):
    with pytest.raises(ValueError, match=reason):
        run(folder, factor)
    assert not (folder / "smaller").exists()


def test_a_missing_photo_is_named_and_nothing_is_written(folder):
    (folder / "images" / "d.png").unlink()
    with pytest.raises(ValueError, match=r"d\.png"):
        run(folder, 2)
    assert not (folder / "smaller").exists()
