"""One tone curve between renders and photos: what it is, and what it leaves."""

import math

import numpy as np
import pytest

from alignerf.metrics import tone
from tests import judged_cases

PHOTOS = [judged_cases.picture(40 + i, (96, 72)) for i in range(8)]
EVERYWHERE = np.ones((72, 96), bool)


def of(renders, counts=EVERYWHERE):
    return tone.of_views(
        [
            tone.levels_of(photo, render, counts)
            for photo, render in zip(PHOTOS, renders, strict=True)
        ]
    )


def rendered(stops=(0.0, 0.0, 0.0), gamma=1.0):
    """Renders of which the photos would be these stops brighter, by this gamma."""
    return [
        np.clip(
            np.round(255 * (photo / 255 / 2 ** np.array(stops)) ** (1 / gamma)), 0, 255
        ).astype(np.uint8)
        for photo in PHOTOS
    ]


def test_the_photos_themselves_have_none():
    found = of(PHOTOS)
    assert found[:3] == (0.0, 1.0, 0.0)
    assert np.abs(found.even_ev).max() == 0


def test_gain_gamma_and_white_balance_are_told_apart():
    dark = of(rendered((0.33,) * 3))
    assert dark.gain_ev == pytest.approx(0.33, abs=0.02)
    assert (dark.gamma, dark.white_ev) == pytest.approx((1.0, 0.0), abs=0.02)
    curved = of(rendered(gamma=1.3))
    assert curved.gamma == pytest.approx(1.3, abs=0.03)
    assert curved.white_ev < 0.05
    red = of(rendered((0.2, 0.0, -0.1)))
    assert red.white_ev == pytest.approx(0.3, abs=0.03)
    assert red.gamma == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("stops", [(0.0,) * 3, (0.3, 0.0, -0.3), (-0.4, 0.1, 0.4)])
def test_bgr_is_told_from_another_white_balance(stops):
    """By photos that have colours; grey ones say nothing."""
    assert of(rendered(stops)).exchanged > 1.5
    assert of([one[..., ::-1] for one in rendered(gamma=1.2)]).exchanged < 0.7
    grey = np.repeat(PHOTOS[0][..., :1], 3, axis=-1)
    levels = tone.levels_of(grey, grey, EVERYWHERE)
    assert tone.of_views([levels]).exchanged == pytest.approx(1)


def test_what_is_left_is_each_view_s_exposure():
    """A gamma that all have is none of it."""
    stops = np.linspace(-0.3, 0.3, len(PHOTOS))
    renders = [
        np.clip(np.round(one / 2.0**ev), 0, 255).astype(np.uint8)
        for one, ev in zip(rendered(gamma=1.2), stops, strict=True)
    ]
    left = of(renders).even_ev
    assert np.corrcoef(left, stops)[0, 1] > 0.98
    assert np.abs(of(rendered(gamma=1.2)).even_ev).max() < 0.03


def test_views_without_a_level_say_nothing():
    black = [np.zeros_like(photo) for photo in PHOTOS]
    assert all(map(math.isnan, of(black)[:3]))
    assert np.isnan(of(PHOTOS, ~EVERYWHERE).even_ev).all()
    assert math.isnan(tone.of_views([]).gamma)
    flat = [np.full_like(photo, 90) for photo in PHOTOS]
    assert math.isnan(of(flat).gamma)
    assert np.isfinite([of(flat).gain_ev, of(flat).white_ev]).all()
