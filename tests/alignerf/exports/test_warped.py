"""Photos warped once more at their own size."""

import numpy as np
import pytest

from alignerf.exports import formats, warps
from alignerf.io import images
from alignerf.readers import transforms
from alignerf.scenes import prepared
from flow.warping import small, warp
from tests import export_cases as cases


@pytest.fixture
def warped(made, tmp_path, rng):
    """Smooth flows of the training views, by which their small photos are warped."""
    loaded = prepared.load(made)
    for name in ("warped", "valid", "offsets"):
        (tmp_path / name).mkdir()
    h, w = loaded.height, loaded.width
    for view in loaded.views("train"):
        name = loaded.names[view]
        offsets_px = rng.normal(size=(h // 4, w // 4, 2)).astype(np.float32)
        flow_px = small.enlarge(offsets_px, 4, (h, w))
        valid = warp.in_frame(flow_px) & (rng.uniform(size=(h, w)) < 0.98)
        photo = images.read(made / "images" / f"{name}.png")
        images.write(tmp_path / "warped" / f"{name}.png", warp.warp(photo, flow_px))
        np.savez(tmp_path / "valid" / f"{name}.npz", flow_px=flow_px, valid=valid)
        np.savez(
            tmp_path / "offsets" / f"{name}.npz",
            valid=valid,
            offsets_px=offsets_px,
            shrink=4,
        )
    return tmp_path


def by_hand(photo, flow_px, valid):
    """A photo of twice the size warped by a flow, pixel by pixel of the flow."""
    large_px = small.enlarge(flow_px, 2, photo.shape[:2])
    # Twice the part of the small pixels around that are valid.
    twice = small.enlarge(np.stack([valid] * 2, axis=-1), 2, photo.shape[:2])[..., 0]
    inside = (twice > 2 - 2e-3) & warp.in_frame(large_px)
    return warp.warp(photo, large_px), inside


@pytest.mark.parametrize(
    "valid", ["valid", pytest.param("offsets", marks=pytest.mark.whole)]
)
def test_photos_are_warped_at_full_size(made, views, warped, valid):
    """By a round's flow, and by the offsets of a training that warped on its way."""
    more = ("--warped", warped / "warped", "--valid", warped / valid)
    out = cases.exported(made, warped, *more)
    cases.check_cameras(out, views)
    for i, name in enumerate(views.names):
        image = images.read(out / "images" / f"{name}.png")
        photo, inside = (
            views.photos[i].read(),
            np.ones((cases.HEIGHT, cases.WIDTH), bool),
        )
        if views.split[i] == "train":
            with np.load(warped / "valid" / f"{name}.npz") as found:
                photo, inside = by_hand(photo, found["flow_px"], found["valid"])
        # Positions are rounded to 1/32 px.
        assert np.abs(image.astype(int) - photo).mean() < 0.02
        mask = transforms.read(out)[0].masks[i].read()
        assert (mask.all(axis=-1) == inside).mean() > 0.999
        assert (out / formats.MASK.format(view=name)).is_file()
    assert "masks/ says where" in (out / "README.txt").read_text()


def test_warps_that_are_not_on_disk_leave_the_size_of_training(made, warped, caplog):
    for path in (warped / "valid").iterdir():
        with np.load(path) as found:
            np.savez(path, valid=found["valid"])
    more = ("--warped", warped / "warped", "--valid", warped / "valid")
    out = cases.exported(made, warped, *more)
    for path in (warped / "warped").iterdir():
        np.testing.assert_array_equal(
            images.read(path), images.read(out / "images" / path.name)
        )
    assert "does not say how photos were warped" in caplog.text
    text = (out / "README.txt").read_text()
    assert "how they were warped is not on disk" in text


def test_a_flow_is_enlarged_by_each_axis_s_own_ratio(rng):
    flow_px = np.broadcast_to(np.float32([2, 3]), (20, 30, 2))
    large_px = warps.enlarge(flow_px, (50, 61))
    assert large_px.shape == (50, 61, 2)
    np.testing.assert_allclose(large_px[..., 0], 2 * 61 / 30, rtol=1e-6)
    np.testing.assert_allclose(large_px[..., 1], 3 * 50 / 20, rtol=1e-6)
    # Of twice the size it is what alignments do.
    flow_px = rng.normal(size=(20, 30, 2)).astype(np.float32)
    twice = warps.enlarge(flow_px, (40, 60)), small.enlarge(flow_px, 2, (40, 60))
    np.testing.assert_allclose(*twice, atol=1e-5)
