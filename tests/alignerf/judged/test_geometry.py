"""How a photo became what a render shows."""

import numpy as np
import pytest

from alignerf.judged import geometry
from alignerf.scenes import distortion
from tests.judged_cases import CAMTOPIX, LENS, SIZE, picture, shown

WAYS = list(geometry.WAYS)
FISHEYE = np.array([0.05, -0.01, 0.002, 0.0])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("lens", [LENS, FISHEYE], ids=["opencv", "fisheye"])
def test_a_way_shows_points_where_its_camera_says(way, lens):
    """A dot of the photo lands where the pinhole camera sees its ray."""
    one = shown(way, lens)
    camtopix = one.camtopix
    ray = np.array([0.13, -0.09, 1.0])
    at = camtopix @ ray
    in_photo = distortion.distort_points(ray[None, :2], CAMTOPIX, lens)[0]
    y, x = np.indices(SIZE[::-1]) + 0.5
    dot = np.exp(-((x - in_photo[0]) ** 2 + (y - in_photo[1]) ** 2) / 8)
    photo = np.repeat((250 * dot)[..., None], 3, axis=-1).astype(np.uint8)
    found = one.picture(photo).astype(float)[..., 0]
    y, x = np.indices(found.shape) + 0.5
    centre = [(found * axis).sum() / found.sum() for axis in (x, y)]
    np.testing.assert_allclose(centre, at[:2], atol=0.05)


def test_a_photo_without_distortion_has_one_way():
    found = geometry.ways((CAMTOPIX, np.zeros(5)), SIZE, SIZE, "render")
    assert [one.way for one in found] == ["taken"]
    photo = picture(0)
    assert np.array_equal(found[0].picture(photo), photo)
    assert found[0].inside().all()


def test_smaller_renders_of_rounded_size():
    """A photo of 160x120 made 57 wide is 43 high, not 42.75."""
    (one,) = geometry.ways((CAMTOPIX, np.zeros(5)), SIZE, (57, 43), "render")
    assert one.picture(picture(0)).shape == (43, 57, 3)
    np.testing.assert_allclose(one.camtopix[0, 2], CAMTOPIX[0, 2] * 57 / 160)
    np.testing.assert_allclose(one.camtopix[1, 2], CAMTOPIX[1, 2] * 43 / 120)


def test_what_lies_outside_the_photo_does_not_count():
    """A lens that bends inwards leaves corners empty if the focal length is kept."""
    barrel = shown("kept", np.array([-0.18, 0, 0, 0, 0]))
    pincushion = shown("kept", np.array([0.3, 0, 0, 0, 0]))
    assert barrel.inside().all()
    assert not pincushion.inside()[0, 0]
    assert pincushion.inside()[60, 80]
    mask = pincushion.mask(np.full((120, 160, 3), 255, np.uint8))
    assert (mask[0, 0] == 0).all()
    assert (mask[60, 80] == 255).all()


def test_a_distorted_render_is_undone_like_its_photo():
    one = shown("taken")
    photo = picture(0)
    assert np.abs(one.render(photo).astype(int) - one.picture(photo)).max() <= 1


def test_another_shape_is_refused():
    with pytest.raises(ValueError, match=r"a/b.png: 100x100 .* \(160x120, 160x120"):
        geometry.ways((CAMTOPIX, LENS), SIZE, (100, 100), "a/b.png")


def test_the_photos_own_size():
    """As large as the photo's focal length allows, the same picture."""
    one = geometry.ways((CAMTOPIX, LENS), SIZE, (80, 60), "render")[1]
    assert geometry.photos_size(one) == (160, 120)
    large = geometry.at_size(one, (160, 120))
    assert large.way == "kept"
    assert large.size == (160, 120)
    np.testing.assert_allclose(large.camtopix, CAMTOPIX, rtol=1e-6)


def test_a_size_that_was_rounded_bends_no_photo():
    """A render of 53x40 of a photo of 160x120 has no square pixels."""
    one = geometry.ways((CAMTOPIX, np.zeros(5)), SIZE, (53, 40), "render")[0]
    large = geometry.at_size(one, geometry.photos_size(one))
    np.testing.assert_allclose(large.camtopix, CAMTOPIX, rtol=1e-9)
    np.testing.assert_array_equal(large.picture(picture(0)), picture(0))
