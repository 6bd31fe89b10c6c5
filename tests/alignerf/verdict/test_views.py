"""Photos against renders: what is measured of a view, and what stands out."""

import cv2
import numpy as np
import pytest
from skimage import data

from alignerf.verdict import views

EVERYWHERE = np.ones((96, 128), bool)


@pytest.fixture
def photo():
    return np.ascontiguousarray(data.astronaut()[100:196, 150:278])


def test_a_blurred_photo_has_less_detail_than_its_render(photo):
    soft = cv2.GaussianBlur(photo, (0, 0), 2.0)
    assert views.measured(soft, photo, EVERYWHERE)["sharpness_ratio"] < 0.5
    assert views.measured(photo, soft, EVERYWHERE)["sharpness_ratio"] > 2
    assert views.measured(photo, photo.copy(), EVERYWHERE)["sharpness_ratio"] == 1.0


@pytest.mark.parametrize("stops", [-0.5, 0.25])
def test_exposure_is_found_in_stops(photo, stops):
    dim = (0.4 * photo).astype(np.uint8)
    changed = np.clip(dim * 2.0**stops, 0, 255).astype(np.uint8)
    found = views.measured(changed, dim, EVERYWHERE)["exposure_ev"]
    assert found == pytest.approx(stops, abs=0.03)


def test_black_and_white_photos_are_finite():
    for level in (0, 255):
        flat = np.full((96, 128, 3), level, np.uint8)
        other = np.full((96, 128, 3), 255 - level, np.uint8)
        found = views.measured(flat, other, ~EVERYWHERE)
        assert np.isfinite(list(found.values())).all()


def view(name, **changes):
    usual = {
        "split": "train",
        "psnr_db": 25.0,
        "cc_psnr_db": 25.0,
        "flow_px": 0.1,
        "camera_px": 0.1,
        "remainder_px": 0.05,
        "moved_fraction": 0.0,
        "sharpness_ratio": 1.2,
        "exposure_ev": 0.0,
        "blur_sigma_px": 0.75,
    }
    return views.View(view=name, **usual | changes)


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        ({"flow_px": 3.0}, "misaligned"),
        ({"sharpness_ratio": 0.3}, "blurred"),
        ({"exposure_ev": -0.5}, "darker"),
        ({"exposure_ev": 0.5}, "brighter"),
        ({"moved_fraction": 0.5}, "moved"),
        ({"psnr_db": 8.0}, "farther"),
    ],
)
def test_one_odd_photo_stands_out_and_says_why(changes, what):
    found = views.named([*(view(f"v{i}") for i in range(8)), view("odd", **changes)])
    assert [v.view for v in found if v.stands_out] == ["odd"]
    assert what in found[-1].stands_out


def test_of_few_views_none_stands_out():
    found = views.named([view("a"), view("b"), view("c", flow_px=9.0)])
    assert not [v for v in found if v.stands_out]


def test_a_sky_has_no_texture_and_grain_on_it_none(rng):
    """A flow there is the estimator's own: of a castle a tenth of each photo moved."""
    photo = np.full((60, 80, 3), 180, np.uint8)
    photo[:30] += rng.integers(0, 3, (30, 80, 1), dtype=np.uint8)
    photo[40:] = rng.integers(100, 140, (20, 80, 1), dtype=np.uint8)
    found = views.textured(photo)
    assert not found[:25].any()
    assert found[50:].all()


@pytest.mark.parametrize("seed", range(20))
def test_the_farthest_photo_is_told_first_and_six_are_compared_with_all(seed):
    """Six held-out ones that are alike made one at 3.0 px stand out beside 5.7."""
    rng = np.random.default_rng(seed)
    px = [*rng.uniform(0.2, 6, 24), *rng.normal(0.5, 0.02, 5), 3.0]
    splits = ["train"] * 24 + ["test"] * 6
    rows = [
        view(str(i), camera_px=each, flow_px=each, split=split)
        for i, (each, split) in enumerate(zip(px, splits, strict=True))
    ]
    assert not views.odd(views.named(rows))
    right = [one._replace(camera_px=0.1) for one in rows]
    places = rng.permutation(30)[:3]
    for place, each in zip(places, (2.0, 9.0, 5.0), strict=True):
        right[place] = right[place]._replace(camera_px=each)
    found = views.odd(views.named(right))
    assert [one.camera_px for one in found] == [9.0, 5.0, 2.0]
    # A render of another photo is told before all others.
    swapped = [*found, view("swapped", stands_out="shows view_7")]
    assert views.odd(swapped)[0].view == "swapped"


def test_somebody_in_a_few_photos_stands_out():
    rows = [view(str(i), psnr_db=29 + 0.3 * (i % 5)) for i in range(18)]
    rows += [view(f"late{db}", psnr_db=db) for db in (17, 19, 20, 20.9, 18, 19)]
    found = [row.stands_out for row in views.named(rows)]
    assert found[:18] == [""] * 18
    assert all("much farther from its render" in why for why in found[18:])
