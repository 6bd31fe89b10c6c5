"""What another lens alone explains: each of its parts is found, and poses are none."""

import math

import numpy as np
import pytest

from alignerf.scenes import cameras as posed
from alignerf.sfm import lens
from tests.alignerf.sfm import made


def changed(cameras, *, focal=1.0, centre=(0.0, 0.0)):
    camtopix = cameras.camtopix.copy()
    camtopix[:, [0, 1], [0, 1]] *= focal
    camtopix[:, :2, 2] += centre
    return cameras._replace(camtopix=camtopix)


def test_a_right_lens_stays(rng):
    true = made.cameras()
    found, _ = lens.fit(made.matched(true, rng), true)
    assert found.changed == []
    assert found.after_px == found.before_px
    assert found.told()["focal_ratio"] == 1.0


def test_a_focal_length_is_found(rng):
    true = made.cameras()
    found, _ = lens.fit(made.matched(true, rng), changed(true, focal=1.03))
    assert found.changed == ["focal"]
    assert found.focal_ratio == pytest.approx(1 / 1.03, rel=2e-3)
    assert found.after_px < 0.9 * found.before_px


def test_a_principal_point_is_found_in_px_of_the_photo(rng):
    true = made.cameras()
    wrong = changed(true, centre=(4.0, -3.0))
    found, _ = lens.fit(made.matched(true, rng), wrong, photo_px=2.0)
    assert found.changed == ["centre"]
    assert found.centre_px == pytest.approx(10.0, rel=0.1)


def test_a_distortion_is_found(rng):
    bent = made.cameras(distortion=(0.08, 0.0, 0.0, 0.0, 0.0))
    straight = bent._replace(distortion=np.zeros_like(bent.distortion))
    found, _ = lens.fit(made.matched(bent, rng), straight)
    assert found.changed == ["distortion"]
    half = math.hypot(bent.camtopix[0, 0, 2], bent.camtopix[0, 1, 2])
    corner = half * 0.08 * (half / bent.camtopix[0, 0, 0]) ** 2
    assert found.distortion_px == pytest.approx(corner, rel=0.15)


def test_a_rolling_shutter_is_found(rng):
    """Keypoints of later rows are where the camera's motion has brought them."""
    true = made.cameras(24)
    found = made.matched(true, rng)
    skewed = [
        xy - 5.0 * motion
        for xy, motion in zip(
            found.keypoints, lens.motions_of(found, true), strict=True
        )
    ]
    told, _ = lens.fit(found._replace(keypoints=skewed), true)
    assert told.changed == ["shutter"]
    assert told.shutter_px == pytest.approx(5.0, rel=0.1)


@pytest.mark.parametrize("px", [1.0, 5.0])
def test_wrong_poses_are_no_lens(rng, px):
    true = made.cameras()
    poses = posed.perturb_poses(true.camtoworlds, true.pixtocams, px, rng)
    found, _ = lens.fit(made.matched(true, rng), true._replace(camtoworlds=poses))
    # A lens may take a little of them away, by chance.
    assert found.after_px > 0.8 * found.before_px


def test_a_lens_that_no_camera_has_is_none(rng):
    true = made.cameras()
    found, _ = lens.fit(made.matched(true, rng), changed(true, focal=3.0))
    assert found.changed == []


def test_without_matches_nothing_is_said(rng):
    true = made.cameras()
    none = made.matched(true, rng, unseen=range(12))
    found, _ = lens.fit(none, changed(true, focal=1.1))
    assert found.changed == []
    assert found.told()["before_px"] is None


def test_cameras_at_one_place_and_photos_in_no_order(rng):
    """No base has a depth, and no motion a length: numbers stay finite."""
    true = made.cameras()
    poses = true.camtoworlds.copy()
    poses[:, :, 3] = poses[0, :, 3]
    found = made.matched(true, rng)
    for cameras in (
        true._replace(camtoworlds=poses),
        true._replace(camtoworlds=true.camtoworlds[::-1]),
    ):
        told, _ = lens.fit(found, cameras)
        assert np.isfinite([told.focal_ratio, told.shutter_px, told.after_px]).all()
