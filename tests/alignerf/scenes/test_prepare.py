"""Views brought to the resolution of training."""

import numpy as np
import pytest

from alignerf.scenes import cameras, prepare


def views_of(count, width, height, image=None):
    return prepare.PosedViews(
        names=[f"v{i}" for i in range(count)],
        pixtocams=np.stack([cameras.intrinsics(80.0, width, height)] * count),
        camtoworlds=np.stack([np.eye(4)[:3]] * count),
        width=width,
        height=height,
        photos=[prepare.Photo(image)] * count,
    )


@pytest.mark.parametrize("count", [1, 20, 300])
def test_the_min_factor_that_leaves_so_many_pixels(count):
    most, views = 20_000_000, views_of(count, 4032, 3024)
    factor = prepare.factor_for(views, most, 200)
    small = prepare.downscale(views, factor)
    assert count * small.width * small.height <= most
    if factor > 1:
        larger = prepare.downscale(views, factor - 1)
        assert count * larger.width * larger.height > most


def test_many_photos_do_not_become_tiny():
    views = views_of(5000, 4032, 3024)
    small = prepare.downscale(views, prepare.factor_for(views, 10_000_000, 200))
    assert 200 <= small.height <= 210
    tiny = views_of(5000, 64, 48)
    assert prepare.factor_for(tiny, 10_000, 200) == 1


def test_downscaling_follows_the_true_ratio():
    pixels = np.random.default_rng(0).integers(0, 256, (135, 201, 3), dtype=np.uint8)
    views = views_of(1, 201, 135, pixels)
    small = prepare.downscale(views, 4)
    assert (small.width, small.height) == (50, 34)
    corner = small.pixtocams[0] @ [50, 34, 1]
    np.testing.assert_allclose(corner, views.pixtocams[0] @ [201, 135, 1])
    np.testing.assert_allclose(small.photos[0].read().mean(), pixels.mean(), atol=0.5)
    with pytest.raises(ValueError, match="downscale: 5"):
        prepare.downscale(views, 5)
