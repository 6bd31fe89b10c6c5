"""Photos of several sizes and lenses at one angle a pixel: where each pixel lands."""

import numpy as np
import pytest

from alignerf.colmap import canvas
from alignerf.scenes import prepare

SIZE = (80, 60)
FOCAL_PX = 100.0


def world(u, v):
    """Colours of a world without end at the tangents of viewing angles: smooth."""
    waves = np.stack([np.sin(9 * u), np.sin(9 * v), np.sin(5 * (u + v))], axis=-1)
    return 127.5 + 100 * waves


def lens(focal_px, size, centre):
    middle = np.array(size) / 2 + centre
    camtopix = [[focal_px, 0, middle[0]], [0, focal_px, middle[1]], [0, 0, 1]]
    return np.array(camtopix), np.zeros(5)


def seen(pixtocam, size):
    """What a camera sees, at its pixels' centres."""
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    u, v, _ = np.moveaxis(np.stack([x, y, np.ones_like(x)], -1) @ pixtocam.T, -1, 0)
    return world(u, v)


def views_of(taken, **options):
    """taken: (focal_px, size, centre, camera) of each photo."""
    lenses = [lens(*one[:3]) for one in taken]
    photos = [
        np.round(seen(np.linalg.inv(camtopix), one[1])).astype(np.uint8)
        for (camtopix, _), one in zip(lenses, taken, strict=True)
    ]
    return canvas.views_of(
        [f"{i}" for i in range(len(taken))],
        lenses,
        [one[1] for one in taken],
        np.stack([np.eye(3, 4)] * len(taken)),
        camera_of=[one[3] for one in taken],
        photos=list(map(prepare.Photo, photos)),
        where="HERE",
        **options,
    )


USUAL = [(FOCAL_PX, SIZE, (0.0, 0.0), 1)] * 3


@pytest.mark.parametrize(
    "other",
    [
        # Fewer pixels, more pixels, a wider and a longer lens, another axis.
        (50.0, (40, 30), (0.0, 0.0), 2),
        (200.0, (160, 120), (0.0, 0.0), 2),
        (60.0, (90, 50), (0.0, 0.0), 2),
        (250.0, (100, 100), (3.0, -2.0), 2),
        (130.0, SIZE, (-1.5, 2.5), 2),
    ],
)
def test_every_pixel_shows_what_its_camera_says(other):
    views = views_of([*USUAL, other])
    assert (views.width, views.height) == SIZE
    place = views.names.index("3")
    image = views.photos[place].read()
    counts = (views.masks[place].read() == 255).all(axis=-1)
    camtopix = np.linalg.inv(views.pixtocams[place])
    np.testing.assert_allclose(camtopix[[0, 1], [0, 1]], FOCAL_PX, rtol=0.02)
    assert counts.any()
    difference = np.abs(image - seen(views.pixtocams[place], SIZE))[counts]
    # Half a pixel off would be 4.5 levels at the steepest.
    assert np.median(difference) < 0.8
    assert np.percentile(difference, 99) < 3
    assert not image[~counts].any()


def test_a_lens_estimated_twice_is_not_resampled():
    views = views_of([*USUAL, (FOCAL_PX * 1.01, SIZE, (0.0, 0.0), 2)])
    assert views.masks is None or (views.masks[3].read() == 255).all()
    own = np.linalg.inv(lens(FOCAL_PX * 1.01, SIZE, (0.0, 0.0))[0])
    np.testing.assert_array_equal(views.photos[3].read(), np.round(seen(own, SIZE)))


def test_a_zoom_of_the_usual_size_is_laid_too():
    wide = (FOCAL_PX / 2, SIZE, (0.0, 0.0), 2)
    views = views_of([*USUAL, wide, wide])
    focal_px = np.linalg.inv(views.pixtocams)[:, 0, 0]
    np.testing.assert_allclose(focal_px, FOCAL_PX, rtol=1e-6)
    # A wider photo fills the canvas; a longer one leaves its rim free.
    assert (views.masks[3].read() == 255).all()
    long = views_of([*USUAL, (FOCAL_PX * 2, SIZE, (0.0, 0.0), 2)])
    assert (long.masks[3].read() == 255).mean() == pytest.approx(0.25)


def test_a_wide_lens_among_long_ones_is_never_made_larger_than_the_canvas(monkeypatch):
    monkeypatch.setattr(canvas.cv2, "resize", None)
    views = views_of([*USUAL, (2.0, (400, 300), (0.0, 0.0), 2)])
    assert views.photos[3].read().shape == (60, 80, 3)
    assert (views.masks[3].read() == 255).all()


def test_a_hidden_pixel_does_not_come_through_where_it_is_made_larger():
    hidden = np.full((30, 40, 3), 255, np.uint8)
    hidden[10:15, 10:15] = 0
    full = np.full((60, 80, 3), 255, np.uint8)
    views = views_of(
        [*USUAL, (50.0, (40, 30), (0.0, 0.0), 2)],
        masks=list(map(prepare.Photo, [full, full, full, hidden])),
    )
    valid = (views.masks[3].read() >= 254).all(axis=-1)
    # Twice as large: columns 20 to 30, and what Lanczos reaches on both sides.
    assert not valid[12:38, 12:38].any()
    assert valid[:, 45:].all()
