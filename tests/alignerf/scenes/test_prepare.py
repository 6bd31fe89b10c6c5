"""Views brought to the resolution of training."""

import numpy as np
import pytest

from alignerf.scenes import cameras, prepare


def test_downscaling_follows_the_true_ratio():
    pixels = np.random.default_rng(0).integers(0, 256, (135, 201, 3), dtype=np.uint8)
    views = prepare.PosedViews(
        names=["a"],
        pixtocams=cameras.intrinsics(80.0, 201, 135)[None],
        camtoworlds=np.eye(4)[None, :3],
        width=201,
        height=135,
        load=lambda i: pixels,
    )
    small = prepare.downscale(views, 4)
    assert (small.width, small.height) == (50, 34)
    corner = small.pixtocams[0] @ [50, 34, 1]
    np.testing.assert_allclose(corner, views.pixtocams[0] @ [201, 135, 1])
    np.testing.assert_allclose(small.load(0).mean(), pixels.mean(), atol=0.5)
    with pytest.raises(ValueError, match="downscale: 5"):
        prepare.downscale(views, 5)
